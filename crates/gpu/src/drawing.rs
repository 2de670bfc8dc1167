//! One batch on the device: sending it, and what comes back. While a batch is drawn, the
//! next one can be sent: each has one of two sets of buffers.

use crate::batch::Batch;
use crate::buffers::{Growing, read_back, write_to};
use crate::device::{BINDINGS, Device};
use crate::layout::{
    DRAWN, Draw, FOR_CPU, MOST_PIECES, NO_ROOM, Outcome, PIECE_BYTES, Params, VERTEX_BYTES,
};
use crate::scenes::Scene;
use crate::topologies::Topologies;
use pcadlang_numerics::platform::threads::Pool;
use wgpu::{BufferUsages, SubmissionIndex};

/// Workgroups, each of which draws scene after scene.
const MOST_GROUPS: u64 = 1024;
/// Memory for what scenes need while they are drawn.
const SCRATCH: u64 = 512 << 20;
/// Bytes of the vertices of a batch.
const VERTEX_MEMORY: u64 = 64 << 20;
/// Scenes of a batch.
const MOST_SCENES: usize = 2048;
/// Bytes of draws that are written at once.
const FEW_BYTES: u64 = 1 << 20;
/// Bytes of a visible piece: five numbers.
const OUTPUT_BYTES: u64 = 20;
/// Bytes of the number of visible pieces, padded.
const WRITTEN_BYTES: u64 = 8;

/// The buffers on the device.
pub struct Drawing {
    pub device: Device,
    pub topologies: Topologies,
    inputs: [Growing; 6],
    scratch: [Growing; 2],
    slots: [Slot; 2],
    /// Visible pieces and bytes of vertices of a scene, as the last batch had them.
    pieces: u64,
    bytes: u64,
}

/// The buffers of a batch that the processor reads or writes.
struct Slot {
    staging: Growing,
    outputs: [Growing; 3],
    readback: Growing,
    last: Option<SubmissionIndex>,
}

/// A batch that was sent.
pub struct Sent {
    slot: usize,
    scenes: u64,
    /// Pieces for which there is room; 0 if they are not read back.
    room: u64,
}

/// The results: of each scene, and the lists of all pieces.
#[derive(Clone, Copy, Default)]
pub struct Drawn<'a> {
    outcomes: &'a [Outcome],
    pub lists: [&'a [f32]; 5],
}

impl Drawn<'_> {
    /// The outcome of a scene, if it was drawn.
    pub fn outcome(&self, i: usize) -> Option<&Outcome> {
        self.outcomes.get(i).filter(|o| o.status == DRAWN)
    }

    /// True if there were more pieces than room.
    pub fn lacks_room(&self) -> bool {
        self.outcomes.iter().any(|o| o.status == NO_ROOM)
    }
}

impl Drawing {
    /// Opens the device.
    pub fn new(device: Device) -> Drawing {
        let storage = BufferUsages::STORAGE;
        let input = storage | BufferUsages::COPY_DST;
        let uniform = BufferUsages::UNIFORM | BufferUsages::COPY_DST;
        let output = storage | BufferUsages::COPY_SRC;
        let slot = || Slot {
            staging: Growing::new(BufferUsages::MAP_WRITE | BufferUsages::COPY_SRC),
            outputs: [output, output, output | BufferUsages::COPY_DST].map(Growing::new),
            readback: Growing::new(BufferUsages::MAP_READ | BufferUsages::COPY_DST),
            last: None,
        };
        Drawing {
            device,
            topologies: Topologies::default(),
            inputs: [uniform, input, input, input, input, input].map(Growing::new),
            scratch: [storage; 2].map(Growing::new),
            slots: [slot(), slot()],
            pieces: 512,
            bytes: 0,
        }
    }

    /// The next scenes.
    pub fn batch<'a>(&mut self, scenes: &'a [Scene], pool: &Pool) -> Batch<'a> {
        let most = self.device.most_bytes.min(VERTEX_MEMORY);
        // Scenes beyond the last of a batch would be gathered in vain.
        let likely = (most / self.bytes.max(1)).max(1) as usize;
        let count = scenes.len().min(likely).min(MOST_SCENES);
        let batch = Batch::of(&scenes[..count], &mut self.topologies, most, pool);
        self.bytes = batch.vertices.bytes() / batch.items.len().max(1) as u64;
        batch
    }

    /// Writes an input.
    pub fn send<T: bytemuck::Pod>(&mut self, input: usize, list: &[T]) -> Option<()> {
        let Drawing { device, inputs, .. } = self;
        if size_of_val(list) as u64 > device.most_bytes {
            return None;
        }
        inputs[input].with((&device.device, &device.queue), list, device.most_bytes);
        Some(())
    }

    /// Writes the draws of all tasks.
    fn send_draws(&mut self, draws: &[Vec<Draw>]) -> Option<()> {
        let Drawing { device, inputs, .. } = self;
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

    /// Writes the topologies that the device does not have.
    fn send_topologies(&mut self) -> Option<()> {
        let Drawing { device, inputs, topologies, .. } = self;
        let bytes = 4 * topologies.words.len() as u64;
        if bytes > device.most_bytes {
            return None;
        }
        let (buffer, is_new) =
            inputs[3].with_bytes(&device.device, bytes.max(4), device.most_bytes);
        let first = if is_new { 0 } else { topologies.sent };
        if first < topologies.words.len() {
            let words = bytemuck::cast_slice(&topologies.words[first..]);
            device.queue.write_buffer(buffer, 4 * first as u64, words);
        }
        topologies.sent = topologies.words.len();
        Some(())
    }

    /// Sends a batch, to be drawn after what was sent before. Contours come back if
    /// `params` has no distance fields. `None` if the device cannot draw it.
    pub fn submit(
        &mut self,
        batch: &Batch<'_>,
        slot: usize,
        mut params: Params,
        pool: &Pool,
    ) -> Option<Sent> {
        if self.device.error().is_some() {
            return None;
        }
        let pipeline = self.device.pipeline(batch.size)?;
        let (scenes, most) = (batch.items.len() as u64, self.device.most_bytes);
        let [piece_bytes, vertex_bytes] =
            [PIECE_BYTES * u64::from(MOST_PIECES), VERTEX_BYTES * u64::from(batch.most)];
        let groups =
            (most / piece_bytes.max(vertex_bytes)).min(SCRATCH / (piece_bytes + vertex_bytes));
        let groups = groups.min(MOST_GROUPS).min(scenes).max(1);
        let back = params.channels == 0;
        let wanted = (self.pieces + self.pieces / 4 + 16) * scenes;
        let outcome_bytes = scenes * size_of::<Outcome>() as u64;
        let other_bytes = outcome_bytes + WRITTEN_BYTES;
        let room = wanted.min(most.checked_sub(other_bytes)? / OUTPUT_BYTES);
        let room = if back { room } else { 0 };
        params =
            Params { scenes: scenes as u32, room: room as u32, vertices: batch.most, ..params };
        self.send(0, &[params])?;
        self.send(1, &batch.items)?;
        self.send_draws(&batch.draws)?;
        self.send_topologies()?;
        let list_bytes = batch.vertices.bytes();
        if list_bytes > most {
            return None;
        }
        let Drawing { device, inputs, scratch, slots, .. } = self;
        let (gpu, queue) = (&device.device, &device.queue);
        let Slot { staging, outputs, readback, last } = slots.get_mut(slot)?;
        let (staging, _) = staging.with_bytes(gpu, list_bytes, most);
        write_to(gpu, staging, list_bytes, last.as_ref(), |out| batch.vertices.write(out, pool))?;
        inputs[4].with_bytes(gpu, list_bytes, most);
        inputs[5].with_bytes(gpu, 4, most);
        scratch[0].with_bytes(gpu, groups * vertex_bytes, most);
        scratch[1].with_bytes(gpu, groups * piece_bytes, most);
        outputs[0].with_bytes(gpu, outcome_bytes, most);
        outputs[1].with_bytes(gpu, room * OUTPUT_BYTES, most);
        outputs[2].with_bytes(gpu, 4, most);
        let (readback, _) = readback.with_bytes(gpu, other_bytes + room * OUTPUT_BYTES, most);
        let buffers = inputs.iter().chain(scratch.iter()).chain(outputs.iter());
        let buffers: Vec<&wgpu::Buffer> = buffers.filter_map(Growing::get).collect();
        let bound: [&wgpu::Buffer; BINDINGS] = buffers.try_into().ok()?;
        let [_, _, _, _, vertices, .., outcomes, pieces, written] = bound;
        let group = device.bind(bound);
        let mut commands = gpu.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        commands.copy_buffer_to_buffer(staging, 0, vertices, 0, list_bytes);
        commands.clear_buffer(written, 0, Some(4));
        let mut pass = commands.begin_compute_pass(&wgpu::ComputePassDescriptor::default());
        pass.set_pipeline(&pipeline);
        pass.set_bind_group(0, &group, &[]);
        pass.dispatch_workgroups(groups as u32, 1, 1);
        drop(pass);
        commands.copy_buffer_to_buffer(outcomes, 0, readback, 0, outcome_bytes);
        commands.copy_buffer_to_buffer(written, 0, readback, outcome_bytes, 4);
        if room > 0 {
            let bytes = room * OUTPUT_BYTES;
            commands.copy_buffer_to_buffer(pieces, 0, readback, other_bytes, bytes);
        }
        *last = Some(queue.submit([commands.finish()]));
        Some(Sent { slot, scenes, room })
    }

    /// Waits for a batch and calls `read` with what came back; `None` if the device
    /// failed, without calling it.
    pub fn collect<T>(&mut self, sent: &Sent, read: impl FnOnce(Drawn<'_>) -> T) -> Option<T> {
        let Slot { readback, last, .. } = self.slots.get(sent.slot)?;
        let (gpu, sound) = (&self.device.device, self.device.error().is_none());
        let outcome_bytes = sent.scenes * size_of::<Outcome>() as u64;
        let bytes = outcome_bytes + WRITTEN_BYTES + sent.room * OUTPUT_BYTES;
        let (found, out) = read_back(gpu, readback.get()?, bytes, last.as_ref(), |bytes| {
            let (outcomes, rest) = bytes.split_at(outcome_bytes as usize);
            let (written, pieces) = rest.split_at(WRITTEN_BYTES as usize);
            let outcomes: &[Outcome] = bytemuck::cast_slice(outcomes);
            let known = |o: &Outcome| matches!(o.status, DRAWN | FOR_CPU | NO_ROOM);
            let sound = sound && outcomes.iter().all(known);
            let numbers: &[f32] = bytemuck::cast_slice(pieces);
            let mut lists = numbers.chunks_exact((sent.room as usize).max(1));
            let lists = std::array::from_fn(|_| lists.next().unwrap_or_default());
            let found = bytemuck::pod_read_unaligned::<u32>(&written[..4]);
            sound.then(|| (u64::from(found), read(Drawn { outcomes, lists })))
        })??;
        if sent.room > 0 && sent.scenes > 0 {
            self.pieces = found / sent.scenes + 1;
        }
        Some(out)
    }
}
