//! Compute pipelines on a driver's device, and what the driver says of them.

#![expect(unsafe_code, reason = "wgpu does not show what a driver says of its pipelines")]

use std::ffi::{CStr, CString};

use ash::khr::pipeline_executable_properties;
use ash::vk;

use crate::module::ComputeModule;

/// What a driver says of a shader, in the order of [`Self::NAMES`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct Statistics(pub(crate) [u64; Self::NAMES.len()]);

impl Statistics {
    /// Mesa's names, and the headers of their columns. First what is compared first.
    pub(crate) const NAMES: [(&str, &str); 7] = [
        ("VGPRs", "VGPRs"),
        ("Spilled VGPRs", "spilled"),
        ("LDS size", "shared bytes"),
        ("Subgroups per SIMD", "waves"),
        ("Instructions", "instructions"),
        ("Code size", "code bytes"),
        ("Latency", "latency"),
    ];

    /// Reads a row as [`all`] writes it: the shader's name, then the numbers.
    pub(crate) fn parse(row: &str) -> Option<(String, Self)> {
        let mut cells = row.split(' ');
        let name = cells.next()?.to_owned();
        let numbers: Vec<u64> = cells.map(|cell| cell.parse().ok()).collect::<Option<_>>()?;
        Some((name, Self(numbers.try_into().ok()?)))
    }
}

/// The driver, then a row for each module.
pub(crate) fn all(modules: &[ComputeModule]) -> Vec<String> {
    // SAFETY: every object is created here and used by this thread alone. The process ends after this, and with it all of them.
    unsafe { compile(modules) }.unwrap_or_else(|error| panic!("the driver: {error}"))
}

unsafe fn compile(modules: &[ComputeModule]) -> Result<Vec<String>, vk::Result> {
    unsafe {
        let entry = ash::Entry::load().expect("the Vulkan loader");
        let application = vk::ApplicationInfo::default().api_version(vk::API_VERSION_1_2);
        let instance = entry.create_instance(
            &vk::InstanceCreateInfo::default().application_info(&application),
            None,
        )?;
        let physical =
            *instance.enumerate_physical_devices()?.first().expect("a device of the driver");
        let mut driver = vk::PhysicalDeviceDriverProperties::default();
        let mut properties = vk::PhysicalDeviceProperties2::default().push_next(&mut driver);
        instance.get_physical_device_properties2(physical, &mut properties);
        let name = properties.properties.device_name;
        let mut rows = vec![format!("{}, {}", text(&name), text(&driver.driver_info))];

        let mut executable = vk::PhysicalDevicePipelineExecutablePropertiesFeaturesKHR::default()
            .pipeline_executable_info(true);
        let mut memory = vk::PhysicalDeviceVulkan12Features::default().vulkan_memory_model(true);
        let queue = [vk::DeviceQueueCreateInfo::default().queue_priorities(&[1.0])];
        let extensions = [pipeline_executable_properties::NAME.as_ptr()];
        let features = instance.get_physical_device_features(physical);
        let device = instance.create_device(
            physical,
            &vk::DeviceCreateInfo::default()
                .queue_create_infos(&queue)
                .enabled_extension_names(&extensions)
                .enabled_features(&features)
                .push_next(&mut executable)
                .push_next(&mut memory),
            None,
        )?;
        let statistics = pipeline_executable_properties::Device::new(&instance, &device);
        for module in modules {
            let pipeline = pipeline(&device, module)?;
            let info = vk::PipelineExecutableInfoKHR::default().pipeline(pipeline);
            let found: Vec<(String, u64)> = statistics
                .get_pipeline_executable_statistics(&info)?
                .iter()
                .map(|statistic| (text(&statistic.name), statistic.value.u64))
                .collect();
            let numbers = Statistics::NAMES.map(|(name, _)| {
                let value = found.iter().find(|(found, _)| found == name);
                value.map_or_else(
                    || panic!("no {name} in {found:?}"),
                    |(_, value)| value.to_string(),
                )
            });
            rows.push(format!("{} {}", module.entry_point, numbers.join(" ")));
        }
        Ok(rows)
    }
}

unsafe fn pipeline(
    device: &ash::Device,
    module: &ComputeModule,
) -> Result<vk::Pipeline, vk::Result> {
    unsafe {
        let sets = module.bindings.keys().map(|(set, _)| set + 1).max().unwrap_or(0);
        let mut layouts = Vec::new();
        for set in 0..sets {
            let bindings: Vec<_> = module
                .bindings
                .iter()
                .filter(|((owner, _), _)| *owner == set)
                .map(|((_, binding), kind)| {
                    vk::DescriptorSetLayoutBinding::default()
                        .binding(*binding)
                        .descriptor_type(*kind)
                        .descriptor_count(1)
                        .stage_flags(vk::ShaderStageFlags::COMPUTE)
                })
                .collect();
            let info = vk::DescriptorSetLayoutCreateInfo::default().bindings(&bindings);
            layouts.push(device.create_descriptor_set_layout(&info, None)?);
        }
        let immediates =
            [vk::PushConstantRange::default().stage_flags(vk::ShaderStageFlags::COMPUTE).size(128)];
        let layout = device.create_pipeline_layout(
            &vk::PipelineLayoutCreateInfo::default()
                .set_layouts(&layouts)
                .push_constant_ranges(&immediates),
            None,
        )?;
        let code = device.create_shader_module(
            &vk::ShaderModuleCreateInfo::default().code(&module.words),
            None,
        )?;
        let name = CString::new(module.entry_point.as_str()).expect("a name without zeros");
        let stage = vk::PipelineShaderStageCreateInfo::default()
            .stage(vk::ShaderStageFlags::COMPUTE)
            .module(code)
            .name(&name);
        let info = vk::ComputePipelineCreateInfo::default()
            .flags(vk::PipelineCreateFlags::CAPTURE_STATISTICS_KHR)
            .stage(stage)
            .layout(layout);
        device
            .create_compute_pipelines(vk::PipelineCache::null(), &[info], None)
            .map(|pipelines| pipelines[0])
            .map_err(|(_, error)| error)
    }
}

fn text(name: &[std::ffi::c_char]) -> String {
    // SAFETY: Vulkan's names end with a zero within their array.
    unsafe { CStr::from_ptr(name.as_ptr()) }.to_string_lossy().into_owned()
}
