//! A device that is owned or lent.

use super::Device;

/// A device, owned or lent: what lives as long as its buffers takes either.
#[expect(missing_debug_implementations, reason = "devices are opaque")]
pub enum Held<'d> {
    /// Owned.
    Own(Box<dyn Device + 'd>),
    /// Lent.
    Lent(&'d mut dyn Device),
}

impl<'d> Held<'d> {
    pub(crate) fn get(&mut self) -> &mut (dyn Device + 'd) {
        match self {
            Self::Own(device) => &mut **device,
            Self::Lent(device) => &mut **device,
        }
    }
}

impl<'d, 'o: 'd> From<Box<dyn Device + 'o>> for Held<'d> {
    fn from(device: Box<dyn Device + 'o>) -> Self {
        Self::Own(device)
    }
}

impl<'d> From<Box<dyn Device + Send + 'd>> for Held<'d> {
    fn from(device: Box<dyn Device + Send + 'd>) -> Self {
        Self::Own(device)
    }
}

impl<'d, 'x: 'd> From<&'d mut (dyn Device + 'x)> for Held<'d> {
    fn from(device: &'d mut (dyn Device + 'x)) -> Self {
        Self::Lent(device)
    }
}

impl<'d, D: Device> From<&'d mut D> for Held<'d> {
    fn from(device: &'d mut D) -> Self {
        Self::Lent(device)
    }
}
