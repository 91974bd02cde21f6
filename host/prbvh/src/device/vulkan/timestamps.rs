//! When commands began and ended on the device.

use super::error::Call;
use super::logical::LogicalDevice;
use super::objects::QueryPool;
use crate::device::DeviceError;
use ash::vk;
use std::sync::Arc;

/// Timestamps of a queue that keeps the time.
pub(super) struct Timestamps {
    device: Arc<LogicalDevice>,
    pool: QueryPool,
    capacity: u32,
    clock: Clock,
}

impl Timestamps {
    /// Room for `capacity` timestamps; `None` where the queue keeps no time.
    pub(super) fn new(device: &Arc<LogicalDevice>, capacity: u32) -> Result<Option<Self>, DeviceError> {
        let physical = device.physical();
        if physical.timestamp_bits == 0 {
            return Ok(None);
        }
        let clock = Clock::new(physical.timestamp_bits, physical.properties.limits.timestamp_period);
        Ok(Some(Self { device: Arc::clone(device), pool: pool(device, capacity)?, capacity, clock }))
    }

    /// Makes room for `count` timestamps.
    pub(super) fn reserve(&mut self, count: u32) -> Result<(), DeviceError> {
        if count > self.capacity {
            let capacity = count.checked_next_power_of_two().unwrap_or(count);
            self.pool = pool(&self.device, capacity)?;
            self.capacity = capacity;
        }
        Ok(())
    }

    /// Empties timestamps `[0, count)`, for which there is room, and takes the first.
    pub(super) fn begin(&self, device: &ash::Device, commands: vk::CommandBuffer, count: u32) {
        // SAFETY: the command buffer is being recorded, and the pool has room for `count`.
        unsafe { device.cmd_reset_query_pool(commands, self.pool.raw(), 0, count) };
        self.take(device, commands, 0);
    }

    /// Takes timestamp `index` when all earlier commands have ended.
    pub(super) fn take(&self, device: &ash::Device, commands: vk::CommandBuffer, index: u32) {
        let stage = vk::PipelineStageFlags::BOTTOM_OF_PIPE;
        // SAFETY: the command buffer is being recorded, and `begin` reset this timestamp.
        unsafe { device.cmd_write_timestamp(commands, stage, self.pool.raw(), index) };
    }

    /// Seconds between consecutive timestamps `[0, count)` of the last submission.
    pub(super) fn seconds(&self, count: u32) -> Result<Vec<f64>, DeviceError> {
        let mut ticks = vec![0u64; count as usize];
        let flags = vk::QueryResultFlags::TYPE_64 | vk::QueryResultFlags::WAIT;
        // SAFETY: the submission that took them has ended.
        unsafe { self.device.raw().get_query_pool_results(self.pool.raw(), 0, &mut ticks, flags) }
            .call("vkGetQueryPoolResults")?;
        Ok(ticks.windows(2).map(|pair| self.clock.seconds(pair[0], pair[1])).collect())
    }
}

fn pool(device: &Arc<LogicalDevice>, capacity: u32) -> Result<QueryPool, DeviceError> {
    let info = vk::QueryPoolCreateInfo::default().query_type(vk::QueryType::TIMESTAMP).query_count(capacity);
    // SAFETY: a count above 0, of a type that every device has.
    unsafe { QueryPool::new(device, &info) }
}

/// What a timestamp means.
struct Clock {
    mask: u64,
    nanoseconds_per_tick: f64,
}

impl Clock {
    fn new(bits: u32, nanoseconds_per_tick: f32) -> Self {
        let mask = u64::MAX >> (64 - bits.clamp(1, 64));
        Self { mask, nanoseconds_per_tick: nanoseconds_per_tick.into() }
    }

    /// The counter may wrap round between the two.
    fn seconds(&self, begin: u64, end: u64) -> f64 {
        (end.wrapping_sub(begin) & self.mask) as f64 * self.nanoseconds_per_tick / 1e9
    }
}

#[cfg(test)]
mod tests {
    use super::Clock;

    #[test]
    fn a_counter_of_36_bits_wraps_round() {
        let clock = Clock::new(36, 2.0);
        assert_eq!(clock.seconds(100, 1_000_000_100), 2.0);
        assert_eq!(clock.seconds((1 << 36) - 50, 50), 200e-9);
        assert_eq!(clock.seconds(0xabcd << 36 | 10, 10), 0.0, "bits beyond the valid ones mean nothing");
        assert_eq!(Clock::new(64, 1.0).seconds(u64::MAX, 0), 1e-9);
    }
}
