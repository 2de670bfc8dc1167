//! The device, and the pipeline for each size of pictures.

use crate::layout::shader;
use rustc_hash::FxHashMap;
use std::sync::{Arc, OnceLock};
use thiserror::Error;
use wgpu::{
    Backends, BindGroupLayoutEntry, BindingType, BufferBindingType, ComputePipeline,
    DeviceDescriptor, InstanceDescriptor, PipelineCompilationOptions, PowerPreference,
    RequestAdapterOptions, ShaderStages,
};

/// Why there is no device.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
pub enum NoDevice {
    /// The system has no adapter with compute shaders.
    #[error("no GPU was found: {0}")]
    Adapter(String),
    /// The adapter offers less than the shaders need.
    #[error("the GPU `{0}` is too small: {1}")]
    Small(String, &'static str),
    /// The adapter refused.
    #[error("the GPU `{0}` could not be opened: {1}")]
    Refused(String, String),
}

/// The bindings of the shader: the first is uniform, those from `WRITTEN` on are written.
pub const BINDINGS: usize = 11;
const WRITTEN: usize = 6;
/// Bytes of a workgroup's memory for the largest picture.
const SHARED: u32 = 32 * 1024;

/// An open device.
pub struct Device {
    pub device: wgpu::Device,
    pub queue: wgpu::Queue,
    /// Its name and the interface through which it is used.
    pub name: String,
    /// Bytes that a buffer can have.
    pub most_bytes: u64,
    /// The first error, after which nothing more is drawn here.
    error: Arc<OnceLock<String>>,
    bindings: wgpu::BindGroupLayout,
    layout: wgpu::PipelineLayout,
    pipelines: FxHashMap<[u32; 2], Option<ComputePipeline>>,
}

impl Device {
    /// Opens the fastest one.
    pub fn open() -> Result<Device, NoDevice> {
        let instance = wgpu::Instance::new(InstanceDescriptor {
            backends: Backends::PRIMARY,
            ..InstanceDescriptor::new_without_display_handle()
        });
        let adapter = pollster::block_on(instance.request_adapter(&RequestAdapterOptions {
            power_preference: PowerPreference::HighPerformance,
            ..RequestAdapterOptions::default()
        }))
        .map_err(|e| NoDevice::Adapter(e.to_string()))?;
        let (info, limits) = (adapter.get_info(), adapter.limits());
        let name = format!("{} ({})", info.name, info.backend);
        let lacks = [
            (limits.max_storage_buffers_per_shader_stage < BINDINGS as u32 - 1, "too few buffers"),
            (limits.max_compute_workgroup_storage_size < SHARED, "too little shared memory"),
            (limits.max_compute_invocations_per_workgroup < 256, "too few threads in a group"),
        ];
        if let Some((_, what)) = lacks.into_iter().find(|(lacks, _)| *lacks) {
            return Err(NoDevice::Small(name, what));
        }
        let most_bytes = limits.max_storage_buffer_binding_size.min(limits.max_buffer_size);
        let (device, queue) = pollster::block_on(adapter.request_device(&DeviceDescriptor {
            label: Some("pcadlang"),
            required_limits: limits,
            ..DeviceDescriptor::default()
        }))
        .map_err(|e| NoDevice::Refused(name.clone(), e.to_string()))?;
        let error = Arc::new(OnceLock::new());
        let first = Arc::clone(&error);
        device.on_uncaptured_error(Arc::new(move |e| {
            first.get_or_init(|| e.to_string());
        }));
        let entries: Vec<BindGroupLayoutEntry> = (0..BINDINGS).map(entry).collect();
        let bindings = device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
            label: None,
            entries: &entries,
        });
        let layout = device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
            label: None,
            bind_group_layouts: &[Some(&bindings)],
            immediate_size: 0,
        });
        let pipelines = FxHashMap::default();
        Ok(Device { device, queue, name, most_bytes, error, bindings, layout, pipelines })
    }

    /// The first error, after which nothing more is drawn here.
    pub fn error(&self) -> Option<&String> {
        self.error.get()
    }

    /// The pipeline for pictures of a size; `None` if they are too large.
    pub fn pipeline(&mut self, size: [u32; 2]) -> Option<ComputePipeline> {
        let Device { device, layout, pipelines, .. } = self;
        let make = || {
            let module = device.create_shader_module(wgpu::ShaderModuleDescriptor {
                label: Some("contours"),
                source: wgpu::ShaderSource::Wgsl(shader(size)?.into()),
            });
            Some(device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
                label: Some("contours"),
                layout: Some(layout),
                module: &module,
                entry_point: Some("main"),
                compilation_options: PipelineCompilationOptions {
                    zero_initialize_workgroup_memory: false,
                    ..PipelineCompilationOptions::default()
                },
                cache: None,
            }))
        };
        pipelines.entry(size).or_insert_with(make).clone()
    }

    /// A group of all bindings, in order.
    pub fn bind(&self, buffers: [&wgpu::Buffer; BINDINGS]) -> wgpu::BindGroup {
        let entries: Vec<wgpu::BindGroupEntry<'_>> = (0..)
            .zip(buffers)
            .map(|(binding, buffer)| wgpu::BindGroupEntry {
                binding,
                resource: buffer.as_entire_binding(),
            })
            .collect();
        self.device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: None,
            layout: &self.bindings,
            entries: &entries,
        })
    }
}

fn entry(i: usize) -> BindGroupLayoutEntry {
    let ty = match i {
        0 => BufferBindingType::Uniform,
        _ => BufferBindingType::Storage { read_only: i < WRITTEN },
    };
    BindGroupLayoutEntry {
        binding: i as u32,
        visibility: ShaderStages::COMPUTE,
        ty: BindingType::Buffer { ty, has_dynamic_offset: false, min_binding_size: None },
        count: None,
    }
}
