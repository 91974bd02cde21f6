//! A list of commands for a device.

use prbvh_kernel::Kernel;
use std::sync::atomic::{AtomicU64, Ordering};

/// Handle of a buffer on a device.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Buffer {
    /// Number of the buffer: no other one in the process has it, on whatever device.
    pub id: u64,
    /// What it holds.
    pub label: &'static str,
    /// Elements.
    pub length: usize,
    /// Bytes of an element.
    pub element_bytes: usize,
}

impl Buffer {
    /// The handle of a new buffer: for whoever makes a device.
    #[must_use]
    pub fn new(label: &'static str, length: usize, element_bytes: usize) -> Self {
        static NEXT: AtomicU64 = AtomicU64::new(0);
        Self { id: NEXT.fetch_add(1, Ordering::Relaxed), label, length, element_bytes }
    }

    /// Size in bytes.
    #[must_use]
    pub fn bytes(&self) -> u64 {
        self.length as u64 * self.element_bytes as u64
    }

    /// Whether both are handles of the same buffer, whatever its elements.
    pub(crate) fn is_same(&self, other: &Self) -> bool {
        (self.id, self.label, self.bytes()) == (other.id, other.label, other.bytes())
    }
}

/// One kernel over a number of invocations.
#[derive(Clone, Debug)]
pub struct Dispatch {
    /// The kernel.
    pub kernel: Kernel,
    /// Invocations.
    pub count: u32,
    /// Push constants.
    pub push: Vec<u8>,
    /// One buffer per binding.
    pub buffers: Vec<Buffer>,
    /// Where the device finds how many invocations there are; without, there are [`Dispatch::count`] of them.
    pub counted: Option<Counted>,
}

/// The number of invocations of a dispatch, in four words of a buffer: the number itself, and its workgroups along three axes
/// ([`prbvh_kernel::grid::workgroups`]). A device may run as many as the workgroups have.
#[derive(Clone, Debug)]
pub struct Counted {
    /// The buffer.
    pub buffer: Buffer,
    /// Its first word.
    pub word: usize,
}

/// Something for a device to do.
#[derive(Clone, Debug)]
pub enum Command {
    /// Run a kernel.
    Dispatch(Dispatch),
    /// Set every byte of a buffer to 0.
    Clear(Buffer),
    /// Copy the whole of a buffer to another of the same size.
    Copy {
        /// Where from.
        from: Buffer,
        /// Where to.
        to: Buffer,
    },
    /// Bring the first bytes of a buffer along: the host will [download](super::Device::download) them next, which then costs no more time.
    Fetch {
        /// Where from.
        from: Buffer,
        /// How many.
        bytes: usize,
    },
}

impl Command {
    /// The buffers that it needs.
    pub(crate) fn buffers(&self) -> impl Iterator<Item = &Buffer> {
        let (bound, counted, others): (&[Buffer], _, _) = match self {
            Self::Dispatch(dispatch) => (&dispatch.buffers, dispatch.counted.as_ref(), [None, None]),
            Self::Clear(buffer) => (&[], None, [Some(buffer), None]),
            Self::Copy { from, to } => (&[], None, [Some(from), Some(to)]),
            Self::Fetch { from, .. } => (&[], None, [Some(from), None]),
        };
        bound.iter().chain(counted.map(|counted| &counted.buffer)).chain(others.into_iter().flatten())
    }
}

/// Commands, each with the label under which its time is reported.
#[derive(Clone, Debug, Default)]
pub struct Recording {
    commands: Vec<(&'static str, Command)>,
}

impl Recording {
    /// No commands yet.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// The commands in order.
    #[must_use]
    pub fn commands(&self) -> &[(&'static str, Command)] {
        &self.commands
    }

    /// Adds a dispatch of `count` invocations.
    ///
    /// # Panics
    /// If push constants or buffers do not fit the kernel: a mistake of the caller.
    pub fn dispatch<P: bytemuck::Pod>(
        &mut self,
        label: &'static str,
        kernel: Kernel,
        count: u32,
        params: &P,
        buffers: &[&Buffer],
    ) {
        self.dispatch_bytes(label, kernel, count, bytemuck::bytes_of(params), buffers);
    }

    /// Adds a dispatch of as many invocations as the four words from `word` on of `counts` say when it runs, `most` at the most.
    ///
    /// # Panics
    /// As [`Recording::dispatch`], and if `counts` has no such words.
    #[allow(clippy::too_many_arguments, reason = "those of a dispatch and where its number is")]
    pub fn dispatch_counted<P: bytemuck::Pod>(
        &mut self,
        label: &'static str,
        kernel: Kernel,
        most: u32,
        params: &P,
        buffers: &[&Buffer],
        counts: &Buffer,
        word: usize,
    ) {
        assert!(counts.bytes() >= 4 * (word as u64 + 4), "{} has no four words from {word} on", counts.label);
        self.dispatch(label, kernel, most, params, buffers);
        if let Some((_, Command::Dispatch(dispatch))) = self.commands.last_mut() {
            dispatch.counted = Some(Counted { buffer: counts.clone(), word });
        }
    }

    /// Adds a dispatch whose push constants are bytes already.
    ///
    /// # Panics
    /// As [`Recording::dispatch`].
    pub fn dispatch_bytes(
        &mut self,
        label: &'static str,
        kernel: Kernel,
        count: u32,
        push: &[u8],
        buffers: &[&Buffer],
    ) {
        let info = kernel.info();
        assert_eq!(push.len(), info.push_bytes, "push constants of {}", info.name);
        assert_eq!(buffers.len(), info.bindings.len(), "buffers of {}", info.name);
        for (buffer, binding) in buffers.iter().zip(info.bindings) {
            assert_eq!(
                buffer.element_bytes, binding.element_bytes,
                "{} cannot be {} of {}",
                buffer.label, binding.name, info.name
            );
        }
        let buffers = buffers.iter().map(|&buffer| buffer.clone()).collect();
        let push = push.to_vec();
        self.commands.push((label, Command::Dispatch(Dispatch { kernel, count, push, buffers, counted: None })));
    }

    /// Adds a command of another recording.
    pub fn add(&mut self, label: &'static str, command: Command) {
        self.commands.push((label, command));
    }

    /// Adds the clearing of a buffer.
    pub fn clear(&mut self, label: &'static str, buffer: &Buffer) {
        self.commands.push((label, Command::Clear(buffer.clone())));
    }

    /// Adds that the host will read the first `bytes` bytes of a buffer as they are now.
    ///
    /// # Panics
    /// If the buffer is shorter: a mistake of the caller.
    pub fn fetch(&mut self, label: &'static str, from: &Buffer, bytes: usize) {
        assert!(bytes as u64 <= from.bytes(), "{} has no {bytes} bytes", from.label);
        self.commands.push((label, Command::Fetch { from: from.clone(), bytes }));
    }

    /// Adds a copy of a whole buffer.
    ///
    /// # Panics
    /// If the sizes differ: a mistake of the caller.
    pub fn copy(&mut self, label: &'static str, from: &Buffer, to: &Buffer) {
        assert_eq!(from.bytes(), to.bytes(), "{} is no copy of {}", to.label, from.label);
        self.commands.push((label, Command::Copy { from: from.clone(), to: to.clone() }));
    }
}
