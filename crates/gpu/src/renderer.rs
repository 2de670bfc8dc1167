//! The renderer: batch after batch through the device, the rest through the CPU.

use crate::batch::{Batch, TASKS, size};
use crate::buffers::{Growing, read_back, write_to};
use crate::device::{BINDINGS, Device, NoDevice};
use crate::layout::{
    DRAWN, Draw, FOR_CPU, MOST_PIECES, NO_ROOM, Outcome, PIECE_BYTES, Params, VERTEX_BYTES,
};
use crate::topologies::Topologies;
use pcadlang_numerics::platform::threads::Pool;
use pcadlang_scene::render::{BatchRenderer, ContourBatch, Contours, Scene};
use pcadlang_scene::vision::Chamfer;
use std::ops::Range;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError};
use wgpu::BufferUsages;

/// Workgroups, each of which draws scene after scene.
const MOST_GROUPS: u64 = 1024;
/// Memory for what scenes need while they are drawn.
const SCRATCH: u64 = 512 << 20;
/// Bytes of the vertices of a batch, if the device has buffers of that size.
const VERTEX_MEMORY: u64 = 384 << 20;
/// Bytes of draws that are written at once.
const FEW_BYTES: u64 = 1 << 20;
/// Bytes of a visible piece: five numbers.
const OUTPUT_BYTES: u64 = 20;

/// Draws many scenes on a GPU.
pub struct Gpu {
    state: Mutex<State>,
    pool: Pool,
    name: String,
    by_cpu: AtomicUsize,
}

struct State {
    device: Device,
    topologies: Topologies,
    inputs: [Growing; 6],
    scratch: [Growing; 2],
    outputs: [Growing; 3],
    staging: Growing,
    readback: Growing,
    pieces_back: Growing,
    /// Visible pieces of a scene, as far as is known.
    expected: u64,
}

/// What was written for a batch.
struct Written {
    outcomes: Vec<Outcome>,
    /// Pieces for which there was room, and those that there are.
    room: u64,
    pieces: u64,
}

impl Gpu {
    /// Opens the fastest GPU of the system, through Vulkan, Metal or DirectX 12.
    ///
    /// # Errors
    /// If there is none that can do this.
    pub fn new() -> Result<Gpu, NoDevice> {
        let device = Device::open()?;
        let name = device.name.clone();
        let storage = BufferUsages::STORAGE;
        let input = storage | BufferUsages::COPY_DST;
        let output = storage | BufferUsages::COPY_SRC;
        let back = || Growing::new(BufferUsages::MAP_READ | BufferUsages::COPY_DST);
        let inputs =
            [BufferUsages::UNIFORM | BufferUsages::COPY_DST, input, input, input, input, input];
        let state = State {
            device,
            topologies: Topologies::default(),
            inputs: inputs.map(Growing::new),
            scratch: [storage; 2].map(Growing::new),
            outputs: [output, output, output | BufferUsages::COPY_DST].map(Growing::new),
            staging: Growing::new(BufferUsages::MAP_WRITE | BufferUsages::COPY_SRC),
            readback: back(),
            pieces_back: back(),
            expected: 512,
        };
        Ok(Gpu { state: Mutex::new(state), pool: Pool::new(0), name, by_cpu: AtomicUsize::new(0) })
    }

    /// The device's name and the interface through which it is used.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// What went wrong on the device, after which the CPU draws everything.
    pub fn error(&self) -> Option<String> {
        self.lock().device.error().cloned()
    }

    /// How many scenes the CPU has drawn so far.
    pub fn drawn_by_cpu(&self) -> usize {
        self.by_cpu.load(Ordering::Relaxed)
    }

    /// The log-likelihood of each scene's contours given one picture's, as
    /// [`Chamfer::log_likelihood`]. Nothing but a score comes back from the device, unless
    /// the distance is symmetric: then the contours are read back.
    ///
    /// All pictures must have the size for which the comparator was prepared.
    pub fn log_likelihoods(&self, scenes: &[Scene], chamfer: &Chamfer) -> Vec<f64> {
        let Some(field) = chamfer.distance_field() else {
            let contours = self.contours(scenes);
            let each = |i: usize| chamfer.log_likelihood(&contours.scene(i));
            return self.pool.map((0..scenes.len()).collect(), each);
        };
        let params = Params {
            channels: field.channels.len() as u32,
            size: [field.width, field.height],
            scale: field.scale,
            percent: field.percent as f32,
            truncate: field.truncate.map_or(f32::MAX, |t| t as f32),
            ..Params::default()
        };
        let mut state = self.lock();
        let numbers: Vec<f32> = field.channels.iter().flatten().copied().collect();
        let sent = state.send(5, &numbers).is_some();
        let mut scores = Vec::with_capacity(scenes.len());
        while scores.len() < scenes.len() {
            let rest = &scenes[scores.len()..];
            let batch = state.batch(rest, &self.pool);
            let written =
                if sent { state.draw(&batch, size(&rest[0]), params, &self.pool) } else { None };
            let outcomes = written.map_or(Vec::new(), |w| w.outcomes);
            let left = self.pool.map(self.left(&batch, &outcomes), |i| {
                let Scene { solid, camera } = &rest[i];
                chamfer.log_likelihood(&Contours::of(solid, camera).slice())
            });
            let mut left = left.into_iter();
            for (i, for_cpu) in batch.for_cpu.iter().enumerate() {
                let drawn = outcomes.get(i).filter(|o| !for_cpu && o.status == DRAWN);
                scores.extend(match drawn {
                    Some(o) => {
                        let [length, first, second, _] = o.sums.map(f64::from);
                        Some(chamfer.log_likelihood_of([length, first, second]))
                    }
                    None => left.next(),
                });
            }
        }
        scores
    }

    fn lock(&self) -> MutexGuard<'_, State> {
        let mut state = self.state.lock().unwrap_or_else(PoisonError::into_inner);
        state.topologies.tidy();
        state
    }

    /// The scenes of a batch that are for the CPU.
    fn left(&self, batch: &Batch<'_>, outcomes: &[Outcome]) -> Vec<usize> {
        let drawn = |i: usize| outcomes.get(i).is_some_and(|o| o.status == DRAWN);
        let left: Vec<usize> =
            (0..batch.items.len()).filter(|&i| batch.for_cpu[i] || !drawn(i)).collect();
        self.by_cpu.fetch_add(left.len(), Ordering::Relaxed);
        left
    }
}

/// Where the pieces of a scene are.
enum Part<'a> {
    Gpu(Range<usize>),
    Cpu(&'a Contours),
}

impl Part<'_> {
    fn len(&self) -> usize {
        match self {
            Part::Gpu(range) => range.len(),
            Part::Cpu(contours) => contours.len(),
        }
    }
}

/// Appends the pieces of scenes, list by list on several cores. `lists` are those that the
/// device wrote.
fn append(out: &mut ContourBatch, lists: [&[f32]; 5], parts: &[Part<'_>], pool: &Pool) {
    let ContourBatch { x, y, tx, ty, length, .. } = out;
    let (first, more) = (x.len(), parts.iter().map(Part::len).sum::<usize>());
    let mut tasks = Vec::new();
    for (k, (out, list)) in [x, y, tx, ty, length].into_iter().zip(lists).enumerate() {
        if first == 0 {
            // Zeros that cost nothing before they are written, which is done below.
            *out = vec![0.0; more];
        } else {
            out.resize(first + more, 0.0);
        }
        let mut rest = &mut out[first..];
        for parts in parts.chunks(parts.len().div_ceil(TASKS).max(1)) {
            let count = parts.iter().map(Part::len).sum();
            let (own, after) = rest.split_at_mut(count);
            rest = after;
            tasks.push((k, list, parts, own));
        }
    }
    pool.map(tasks, |(k, list, parts, mut out)| {
        for part in parts {
            let (own, after) = out.split_at_mut(part.len());
            out = after;
            own.copy_from_slice(match part {
                Part::Gpu(range) => &list[range.clone()],
                Part::Cpu(c) => [&c.x, &c.y, &c.tx, &c.ty, &c.length][k],
            });
        }
    });
}

impl BatchRenderer for Gpu {
    /// As the CPU's within the tolerance that this crate states.
    fn contours(&self, scenes: &[Scene]) -> ContourBatch {
        let mut state = self.lock();
        let mut out = ContourBatch::default();
        while out.ends.len() < scenes.len() {
            let rest = &scenes[out.ends.len()..];
            let batch = state.batch(rest, &self.pool);
            let params = Params::default();
            let mut written = state.draw(&batch, size(&rest[0]), params, &self.pool);
            if written.as_ref().is_some_and(|w| w.outcomes.iter().any(|o| o.status == NO_ROOM)) {
                written = state.draw(&batch, size(&rest[0]), params, &self.pool);
            }
            let outcomes = written.as_ref().map_or(&[][..], |w| &w.outcomes);
            let left = self.pool.map(self.left(&batch, outcomes), |i| {
                (i, Contours::of(&rest[i].solid, &rest[i].camera))
            });
            let mut push = |lists: [&[f32]; 5]| {
                let mut left = left.iter().peekable();
                let mut parts = Vec::with_capacity(batch.items.len());
                let mut end = out.x.len();
                for (i, scene) in rest[..batch.items.len()].iter().enumerate() {
                    let part = match left.next_if(|(of, _)| *of == i) {
                        Some((_, contours)) => Part::Cpu(contours),
                        None => Part::Gpu(outcomes[i].range()),
                    };
                    end += part.len();
                    out.ends.push(end);
                    out.sizes.push(size(scene));
                    parts.push(part);
                }
                append(&mut out, lists, &parts, &self.pool);
            };
            let drawn = outcomes.len() > left.len();
            match written.as_ref().filter(|_| drawn) {
                None => push([&[]; 5]),
                Some(written) => {
                    // Without the pieces, all is for the CPU.
                    if state.pieces(written, push).is_none() {
                        let rest = &rest[..batch.items.len()];
                        self.by_cpu.fetch_add(rest.len(), Ordering::Relaxed);
                        let all = self.pool.map(rest.iter().collect(), |s: &Scene| {
                            Contours::of(&s.solid, &s.camera)
                        });
                        all.iter().for_each(|contours| out.push(contours));
                    }
                }
            }
        }
        out
    }
}

impl State {
    /// The next scenes.
    fn batch<'a>(&mut self, scenes: &'a [Scene], pool: &Pool) -> Batch<'a> {
        let most = self.device.most_bytes.min(VERTEX_MEMORY);
        Batch::of(scenes, &mut self.topologies, most, pool)
    }

    /// Writes the draws of all tasks.
    fn send_draws(&mut self, draws: &[Vec<Draw>]) -> Option<()> {
        let State { device, inputs, .. } = self;
        let count: usize = draws.iter().map(Vec::len).sum();
        let bytes = (count * size_of::<Draw>()) as u64;
        if bytes > device.most_bytes {
            return None;
        }
        let (buffer, _) = inputs[2].with_bytes(&device.device, bytes.max(4), device.most_bytes);
        // A write has its price, and so has a copy of much.
        let together = if bytes < FEW_BYTES { vec![draws.concat()] } else { Vec::new() };
        let lists = if bytes < FEW_BYTES { &together[..] } else { draws };
        let mut at = 0;
        for draws in lists.iter().filter(|draws| !draws.is_empty()) {
            device.queue.write_buffer(buffer, at, bytemuck::cast_slice(draws));
            at += size_of_val(&draws[..]) as u64;
        }
        Some(())
    }

    /// Writes an input.
    fn send<T: bytemuck::Pod>(&mut self, input: usize, list: &[T]) -> Option<()> {
        let State { device, inputs, .. } = self;
        if size_of_val(list) as u64 > device.most_bytes {
            return None;
        }
        inputs[input].with((&device.device, &device.queue), list, device.most_bytes);
        Some(())
    }

    /// Writes the topologies that the device does not have.
    fn send_topologies(&mut self) -> Option<()> {
        let State { device, inputs, topologies, .. } = self;
        let bytes = 4 * topologies.words.len() as u64;
        if bytes > device.most_bytes {
            return None;
        }
        let (buffer, is_new) =
            inputs[3].with_bytes(&device.device, bytes.max(4), device.most_bytes);
        let first =
            if is_new || topologies.sent > topologies.words.len() { 0 } else { topologies.sent };
        if first < topologies.words.len() {
            let words = bytemuck::cast_slice(&topologies.words[first..]);
            device.queue.write_buffer(buffer, 4 * first as u64, words);
        }
        topologies.sent = topologies.words.len();
        Some(())
    }

    /// Draws a batch, with contours left on the device if `params` has no distance fields;
    /// `None` if the device cannot.
    fn draw(
        &mut self,
        batch: &Batch<'_>,
        size: [u32; 2],
        mut params: Params,
        pool: &Pool,
    ) -> Option<Written> {
        if self.device.error().is_some() {
            return None;
        }
        let pipeline = self.device.pipeline(size)?;
        let scenes = batch.items.len() as u64;
        let most = self.device.most_bytes;
        let each = (PIECE_BYTES * u64::from(MOST_PIECES)).max(VERTEX_BYTES * u64::from(batch.most));
        let both = PIECE_BYTES * u64::from(MOST_PIECES) + VERTEX_BYTES * u64::from(batch.most);
        let groups = MOST_GROUPS.min(scenes).min(most / each).min(SCRATCH / both).max(1);
        let wanted = (self.expected + self.expected / 8) * scenes;
        let room = if params.channels == 0 { wanted.clamp(1, most / OUTPUT_BYTES) } else { 1 };
        params =
            Params { scenes: scenes as u32, room: room as u32, vertices: batch.most, ..params };
        self.send(0, &[params])?;
        self.send(1, &batch.items)?;
        self.send_draws(&batch.draws)?;
        self.send_topologies()?;
        let vertex_bytes = batch.vertices.bytes();
        if vertex_bytes > most {
            return None;
        }
        let State { device, inputs, scratch, outputs, staging, readback, .. } = self;
        let (gpu, queue) = (&device.device, &device.queue);
        let (staging, _) = staging.with_bytes(gpu, vertex_bytes, most);
        write_to(gpu, staging, vertex_bytes, |out| batch.vertices.write(out, pool))?;
        inputs[4].with_bytes(gpu, vertex_bytes, most);
        inputs[5].with_bytes(gpu, 4, most);
        scratch[0].with_bytes(gpu, groups * VERTEX_BYTES * u64::from(batch.most), most);
        scratch[1].with_bytes(gpu, groups * PIECE_BYTES * u64::from(MOST_PIECES), most);
        let outcome_bytes = scenes * size_of::<Outcome>() as u64;
        outputs[0].with_bytes(gpu, outcome_bytes, most);
        outputs[1].with_bytes(gpu, room * OUTPUT_BYTES, most);
        outputs[2].with_bytes(gpu, 4, most);
        readback.with_bytes(gpu, outcome_bytes + 4, most);
        let all: Vec<&wgpu::Buffer> = inputs
            .iter()
            .chain(scratch.iter())
            .chain(outputs.iter())
            .filter_map(Growing::get)
            .collect();
        let bound: [&wgpu::Buffer; BINDINGS] = all.try_into().ok()?;
        let [_, _, _, _, vertices, .., outcomes, _, written] = bound;
        let group = device.bind(bound);
        let mut commands = gpu.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        commands.copy_buffer_to_buffer(staging, 0, vertices, 0, vertex_bytes);
        commands.clear_buffer(written, 0, Some(4));
        let mut pass = commands.begin_compute_pass(&wgpu::ComputePassDescriptor::default());
        pass.set_pipeline(&pipeline);
        pass.set_bind_group(0, &group, &[]);
        pass.dispatch_workgroups(groups as u32, 1, 1);
        drop(pass);
        let back = readback.get()?;
        commands.copy_buffer_to_buffer(outcomes, 0, back, 0, outcome_bytes);
        commands.copy_buffer_to_buffer(written, 0, back, outcome_bytes, 4);
        queue.submit([commands.finish()]);
        let (outcomes, pieces) = read_back(gpu, back, outcome_bytes + 4, |bytes| {
            let (outcomes, pieces) = bytes.split_at(outcome_bytes as usize);
            let pieces: u32 = bytemuck::pod_read_unaligned(pieces);
            (bytemuck::cast_slice::<u8, Outcome>(outcomes).to_vec(), u64::from(pieces))
        })?;
        if params.channels == 0 && scenes > 0 {
            self.expected = self.expected.max(pieces / scenes + 1);
        }
        let sound = outcomes.iter().all(|o| matches!(o.status, DRAWN | FOR_CPU | NO_ROOM));
        (sound && !self.device.error().is_some()).then_some(Written { outcomes, room, pieces })
    }

    /// Reads the pieces of a batch and calls `read` with their lists.
    fn pieces(&mut self, written: &Written, read: impl FnOnce([&[f32]; 5])) -> Option<()> {
        let State { device, outputs, pieces_back, .. } = self;
        let (gpu, most) = (&device.device, device.most_bytes);
        let used = written.pieces.min(written.room);
        if used == 0 {
            read([&[]; 5]);
            return Some(());
        }
        let (back, _) = pieces_back.with_bytes(gpu, used * OUTPUT_BYTES, most);
        let output = outputs[1].get()?;
        let mut commands = gpu.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        for k in 0..5 {
            let (from, to) = (4 * k * written.room, 4 * k * used);
            commands.copy_buffer_to_buffer(output, from, back, to, 4 * used);
        }
        device.queue.submit([commands.finish()]);
        read_back(gpu, back, used * OUTPUT_BYTES, |bytes| {
            let numbers: &[f32] = bytemuck::cast_slice(bytes);
            let mut lists = numbers.chunks_exact(used as usize);
            read(std::array::from_fn(|_| lists.next().unwrap_or_default()));
        })
    }
}
