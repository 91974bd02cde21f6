//! Runs a kernel on every device in every order and compares what comes out.

use crate::devices::with_devices;
use prbvh::device::{Buffer, Device, DeviceError, Recording};
use prbvh_kernel::Kernel;
use std::fmt;

/// One dispatch and its buffers.
#[derive(Clone, Debug)]
pub struct Case {
    kernel: Kernel,
    count: u32,
    push: Vec<u8>,
    buffers: Vec<Vec<u8>>,
}

impl Case {
    /// A dispatch of `count` invocations; buffers follow in the order of the bindings.
    pub fn new<P: bytemuck::Pod>(kernel: Kernel, count: u32, params: &P) -> Self {
        assert_eq!(size_of::<P>(), kernel.info().push_bytes);
        Self { kernel, count, push: bytemuck::bytes_of(params).to_vec(), buffers: Vec::new() }
    }

    /// Adds a buffer with these elements.
    #[must_use]
    pub fn with<T: bytemuck::Pod>(mut self, elements: &[T]) -> Self {
        let binding = self.kernel.info().bindings[self.buffers.len()];
        assert_eq!(size_of::<T>(), binding.element_bytes, "{}", binding.name);
        self.buffers.push(bytemuck::cast_slice(elements).to_vec());
        self
    }

    /// Adds a buffer of zeros.
    #[must_use]
    pub fn zeros(mut self, length: usize) -> Self {
        let binding = self.kernel.info().bindings[self.buffers.len()];
        self.buffers.push(vec![0; length * binding.element_bytes]);
        self
    }

    /// Runs the case on one device.
    ///
    /// # Errors
    /// If the device fails.
    pub fn run_on(&self, device: &mut dyn Device) -> Result<Buffers, DeviceError> {
        let info = self.kernel.info();
        assert_eq!(self.buffers.len(), info.bindings.len(), "buffers of {}", info.name);
        let mut buffers = Vec::new();
        for (bytes, binding) in self.buffers.iter().zip(info.bindings) {
            let length = bytes.len() / binding.element_bytes;
            let buffer = device.allocate(binding.name, length, binding.element_bytes)?;
            device.upload(&buffer, bytes)?;
            buffers.push(buffer);
        }
        let mut recording = Recording::new();
        let bound: Vec<&Buffer> = buffers.iter().collect();
        recording.dispatch_bytes(info.name, self.kernel, self.count, &self.push, &bound);
        device.run(&recording)?;
        let mut contents = Vec::new();
        for buffer in buffers {
            let mut bytes = vec![0; usize::try_from(buffer.bytes()).unwrap_or(usize::MAX)];
            device.download(&buffer, &mut bytes)?;
            device.free(buffer);
            contents.push(bytes);
        }
        Ok(Buffers { names: info.bindings.iter().map(|binding| binding.name).collect(), contents })
    }

    /// Runs the case on every device in every order and returns the common result.
    ///
    /// # Panics
    /// If two results differ, or a device fails.
    #[must_use]
    pub fn run_everywhere(&self) -> Buffers {
        with_devices(|devices| {
            let mut first: Option<(&str, Buffers)> = None;
            for (name, device) in devices {
                let result = self.run_on(&mut **device).unwrap_or_else(|error| panic!("{name}: {error}"));
                match &first {
                    None => first = Some((name, result)),
                    Some((first_name, expected)) => {
                        if let Err(difference) = expected.compare(&result) {
                            panic!("{}: {first_name} and {name} differ: {difference}", self.kernel.info().name);
                        }
                    }
                }
            }
            first.expect("there is always the CPU").1
        })
    }
}

/// Contents of the buffers of a dispatch after it ran.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Buffers {
    names: Vec<&'static str>,
    contents: Vec<Vec<u8>>,
}

/// Where two results part.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Difference {
    /// Name of the buffer.
    pub buffer: &'static str,
    /// First word that differs; the length where the lengths differ.
    pub word: usize,
}

impl fmt::Display for Difference {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "`{}`, word {}", self.buffer, self.word)
    }
}

impl Buffers {
    /// Elements of the buffer called `name`.
    ///
    /// # Panics
    /// If there is no such buffer, or its elements are no `T`.
    #[must_use]
    pub fn get<T: bytemuck::Pod>(&self, name: &str) -> Vec<T> {
        let k = self.names.iter().position(|&have| have == name).unwrap_or_else(|| panic!("no buffer `{name}`"));
        bytemuck::allocation::pod_collect_to_vec(&self.contents[k])
    }

    /// Compares all buffers bit for bit.
    ///
    /// # Errors
    /// The first difference.
    pub fn compare(&self, other: &Self) -> Result<(), Difference> {
        assert!(!self.contents.is_empty() && self.contents.iter().any(|bytes| !bytes.is_empty()), "nothing to compare");
        assert_eq!(self.names, other.names);
        for ((&buffer, a), b) in self.names.iter().zip(&self.contents).zip(&other.contents) {
            if a != b {
                let word = a.chunks(4).zip(b.chunks(4)).position(|(a, b)| a != b);
                return Err(Difference { buffer, word: word.unwrap_or(a.len().min(b.len()) / 4) });
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn buffers(words: [u32; 3]) -> Buffers {
        Buffers { names: vec!["same", "other"], contents: vec![vec![1; 8], bytemuck::cast_slice(&words).to_vec()] }
    }

    #[test]
    fn the_comparer_accepts_equal_buffers() {
        assert_eq!(buffers([1, 2, 3]).compare(&buffers([1, 2, 3])), Ok(()));
    }

    #[test]
    fn the_comparer_finds_one_planted_bit() {
        let difference = buffers([1, 2, 3]).compare(&buffers([1, 2, 3 ^ 0x8000_0000]));
        assert_eq!(difference, Err(Difference { buffer: "other", word: 2 }));
    }

    #[test]
    fn the_comparer_finds_a_missing_tail() {
        let mut short = buffers([1, 2, 3]);
        short.contents[1].truncate(8);
        assert_eq!(buffers([1, 2, 3]).compare(&short), Err(Difference { buffer: "other", word: 2 }));
    }

    #[test]
    #[should_panic(expected = "nothing to compare")]
    fn the_comparer_refuses_empty_results() {
        let empty = Buffers { names: vec!["a"], contents: vec![Vec::new()] };
        let _ = empty.compare(&empty.clone());
    }
}
