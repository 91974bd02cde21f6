//! A device that takes note of what it runs.

use super::{Command, Device, DeviceError, Dispatch, Recording, Timing};
use prbvh_kernel::Kernel;
use std::cell::RefCell;
use std::collections::BTreeSet;
use std::rc::Rc;

/// The last dispatch of [`Kernel::DualSearch`]: shared, as the device is lent out while somebody asks.
pub(crate) type LastSearch = Rc<RefCell<Option<Dispatch>>>;

/// Hands everything on to another device.
pub(crate) struct Watched<'a> {
    device: &'a mut dyn Device,
    ran: BTreeSet<Kernel>,
    last_search: LastSearch,
}

impl<'a> Watched<'a> {
    pub(crate) fn new(device: &'a mut dyn Device) -> Self {
        Self { device, ran: BTreeSet::new(), last_search: LastSearch::default() }
    }

    /// The last search of dual moves, now and later.
    pub(crate) fn last_search(&self) -> LastSearch {
        Rc::clone(&self.last_search)
    }

    /// The kernels that ran.
    pub(crate) fn kernels(&self) -> BTreeSet<Kernel> {
        self.ran.clone()
    }
}

impl super::Layer for Watched<'_> {
    fn inner(&self) -> &dyn Device {
        self.device
    }

    fn inner_mut(&mut self) -> &mut dyn Device {
        self.device
    }

    fn run(&mut self, recording: &Recording) -> Result<Vec<Timing>, DeviceError> {
        for (_, command) in recording.commands() {
            if let Command::Dispatch(dispatch) = command {
                self.ran.insert(dispatch.kernel);
                if dispatch.kernel == Kernel::DualSearch {
                    *self.last_search.borrow_mut() = Some(dispatch.clone());
                }
            }
        }
        self.device.run(recording)
    }
}
