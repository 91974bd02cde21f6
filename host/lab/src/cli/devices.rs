//! `prbvh devices`.

use super::args::DevicesArgs;
use super::stdout::print;
use prbvh::device::cpu::CpuDevice;
use prbvh::device::vulkan::{self, DeviceSummary, KernelStatistics};
use prbvh::device::{Device, DeviceError, Selection};
use prbvh_lab::kernels;
use std::fmt::Write;
use std::process::ExitCode;

pub(super) fn run(args: &DevicesArgs) -> anyhow::Result<ExitCode> {
    let cpu = CpuDevice::new(0)?;
    let vulkan = vulkan::list_devices();
    let kernels: Vec<_> = match &vulkan {
        Ok(devices) if args.kernels => devices.iter().map(told_of_kernels).collect(),
        _ => Vec::new(),
    };
    if args.json {
        let (devices, missing) = match &vulkan {
            Ok(devices) => (devices.as_slice(), None),
            Err(error) => (&[][..], Some(error.to_string())),
        };
        let mut json = serde_json::json!({ "cpu": cpu.info(), "vulkan": devices, "no_vulkan": missing });
        if args.kernels {
            let of_device = |told: &Told| match told {
                Ok(kernels) => serde_json::json!({ "kernels": kernels, "error": null }),
                Err(error) => serde_json::json!({ "kernels": [], "error": error.to_string() }),
            };
            json["kernels"] = kernels.iter().map(of_device).collect();
        }
        print(&serde_json::to_string_pretty(&json)?)?;
    } else {
        print(&format!("cpu         {} ({})", cpu.info().name, cpu.info().driver))?;
        print(vulkan_text(&vulkan).trim_end())?;
        for (device, told) in vulkan.iter().flatten().zip(&kernels) {
            print(&match told {
                Ok(kernels) => format!("\nvulkan:{}\n{}", device.index, kernels::table(kernels)),
                Err(error) => format!("\nvulkan:{}    {error}", device.index),
            })?;
        }
    }
    Ok(ExitCode::SUCCESS)
}

type Told = Result<Vec<KernelStatistics>, DeviceError>;

fn told_of_kernels(device: &DeviceSummary) -> Told {
    vulkan::kernel_statistics(Selection::Index(device.index), false)
}

fn vulkan_text(devices: &Result<Vec<DeviceSummary>, DeviceError>) -> String {
    let mut text = String::new();
    match devices {
        Err(error) => text = format!("no Vulkan device: {error}"),
        Ok(devices) => {
            for device in devices {
                describe(&mut text, device);
            }
        }
    }
    text
}

fn describe(text: &mut String, device: &DeviceSummary) {
    const MIB: u64 = 1 << 20;
    let atomics = if device.shader_buffer_int64_atomics { "one 64-bit word" } else { "two 32-bit words" };
    let lines = [
        format!("vulkan:{:<4} {} ({}, {})", device.index, device.name, device.device_type, device.driver),
        format!("            Vulkan {}, subgroups of {}", device.api_version, device.subgroup_size),
        format!("            maxStorageBufferRange {} MiB", device.max_storage_buffer_range / MIB),
        format!("            maxMemoryAllocationSize {} MiB", device.max_memory_allocation_size / MIB),
        format!("            device memory {} MiB", device.heap_bytes / MIB),
        format!("            maxComputeWorkGroupCount {:?}", device.max_compute_work_group_count),
        format!("            maxPushConstantsSize {}", device.max_push_constants_size),
        format!("            locks of {atomics} (shaderBufferInt64Atomics)"),
    ];
    for line in lines {
        let _ = writeln!(text, "{line}");
    }
    for missing in &device.missing {
        let _ = writeln!(text, "            cannot run prbvh: lacks {missing}");
    }
}
