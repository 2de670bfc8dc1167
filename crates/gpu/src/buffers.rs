//! Buffers of the device that grow, and reading them back.

use bytemuck::Pod;
use wgpu::{
    Buffer, BufferUsages, BufferView, Device, MapMode, PollType, Queue, SubmissionIndex, WriteOnly,
};

/// A buffer that is replaced by a larger one when it becomes too small.
pub struct Growing {
    buffer: Option<Buffer>,
    usage: BufferUsages,
}

impl Growing {
    /// Nothing yet.
    pub const fn new(usage: BufferUsages) -> Growing {
        Growing { buffer: None, usage }
    }

    /// The buffer, with at least this many bytes; whether it is a new one.
    pub fn with_bytes(&mut self, device: &Device, bytes: u64, most: u64) -> (&Buffer, bool) {
        let old = self.buffer.take().filter(|b| b.size() >= bytes);
        let is_new = old.is_none();
        let make = || {
            // Half more than needed, so that it seldom grows.
            let size = (bytes + bytes / 2).min(most).max(bytes).max(256).next_multiple_of(256);
            let usage = self.usage;
            let (label, mapped_at_creation) = (None, false);
            device.create_buffer(&wgpu::BufferDescriptor { label, size, usage, mapped_at_creation })
        };
        (self.buffer.insert(old.unwrap_or_else(make)), is_new)
    }

    /// The buffer, with these numbers at its beginning.
    pub fn with<T: Pod>(&mut self, (device, queue): (&Device, &Queue), list: &[T], most: u64) {
        let bytes: &[u8] = bytemuck::cast_slice(list);
        let (buffer, _) = self.with_bytes(device, bytes.len() as u64, most);
        if !bytes.is_empty() {
            queue.write_buffer(buffer, 0, bytes);
        }
    }

    /// The buffer, if it was ever needed.
    pub fn get(&self) -> Option<&Buffer> {
        self.buffer.as_ref()
    }
}

/// Waits for the bytes of a buffer, last used by `after`, and calls `read` with them;
/// `None` if the device failed.
pub fn read_back<T>(
    device: &Device,
    buffer: &Buffer,
    bytes: u64,
    after: Option<&SubmissionIndex>,
    read: impl FnOnce(&BufferView) -> T,
) -> Option<T> {
    map(device, (buffer, bytes), MapMode::Read, after)?;
    let view = buffer.get_mapped_range(0..bytes).ok()?;
    let out = read(&view);
    drop(view);
    buffer.unmap();
    Some(out)
}

/// Calls `write` with the bytes of a buffer, last used by `after`; `None` if the device failed.
pub fn write_to(
    device: &Device,
    buffer: &Buffer,
    bytes: u64,
    after: Option<&SubmissionIndex>,
    write: impl FnOnce(WriteOnly<'_, [u8]>),
) -> Option<()> {
    map(device, (buffer, bytes), MapMode::Write, after)?;
    let mut view = buffer.get_mapped_range_mut(0..bytes).ok()?;
    write(view.slice(..));
    drop(view);
    buffer.unmap();
    Some(())
}

fn map(
    device: &Device,
    (buffer, bytes): (&Buffer, u64),
    mode: MapMode,
    after: Option<&SubmissionIndex>,
) -> Option<()> {
    let (send, receive) = std::sync::mpsc::channel();
    buffer.map_async(mode, 0..bytes, move |done| {
        // Nobody waits any more only if the wait below failed.
        let _ = send.send(done);
    });
    let poll = match after {
        Some(index) => PollType::Wait { submission_index: Some(index.clone()), timeout: None },
        None => PollType::Poll,
    };
    device.poll(poll).ok()?;
    receive.try_recv().ok()?.ok()
}
