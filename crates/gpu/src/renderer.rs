//! The renderer: batch after batch through the device, the rest through the CPU.

use crate::batch::{Batch, TASKS};
use crate::device::{Device, NoDevice};
use crate::drawing::{Drawing, Drawn, Sent};
use crate::layout::Params;
use crate::scenes::{ContourBatch, Scene};
use pcadlang_numerics::platform::threads::Pool;
use pcadlang_scene::render::Contours;
use pcadlang_scene::vision::Chamfer;
use std::ops::Range;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError};

/// Draws many scenes on a GPU.
pub struct Gpu {
    drawing: Mutex<Drawing>,
    pool: Pool,
    name: String,
    by_cpu: AtomicUsize,
}

impl Gpu {
    /// Opens the fastest GPU of the system, through Vulkan, Metal or DirectX 12.
    ///
    /// # Errors
    /// If there is none that can do this.
    pub fn new() -> Result<Gpu, NoDevice> {
        let device = Device::open()?;
        let (name, pool, by_cpu) = (device.name.clone(), Pool::new(0), AtomicUsize::new(0));
        Ok(Gpu { drawing: Mutex::new(Drawing::new(device)), pool, name, by_cpu })
    }

    /// The device's name and the interface through which it is used.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// The fault of the device, after which the CPU draws everything.
    pub fn error(&self) -> Option<String> {
        self.lock().device.error().cloned()
    }

    /// How many scenes the CPU has drawn so far.
    pub fn drawn_by_cpu(&self) -> usize {
        self.by_cpu.load(Ordering::Relaxed)
    }

    /// The log-likelihood of each scene's contours given one picture's, as
    /// [`Chamfer::log_likelihood`]. Nothing but sums comes back from the device, unless
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
        let numbers: Vec<f32> = field.channels.iter().flatten().copied().collect();
        let mut scores = Vec::with_capacity(scenes.len());
        let on_cpu = |scene: &Scene| {
            chamfer.log_likelihood(&Contours::of(&scene.solid, &scene.camera).slice())
        };
        self.each(scenes, params, &numbers, |scenes, batch, drawn| {
            let mut left = self.left(scenes, batch, drawn, on_cpu).into_iter();
            scores.extend((0..scenes.len()).filter_map(|i| {
                match drawn.outcome(i).filter(|_| !batch.for_cpu[i]) {
                    Some(o) => {
                        let [length, first, second, _] = o.sums.map(f64::from);
                        Some(chamfer.log_likelihood_of([length, first, second]))
                    }
                    None => left.next().map(|(_, score)| score),
                }
            }));
        });
        scores
    }

    fn lock(&self) -> MutexGuard<'_, Drawing> {
        let mut drawing = self.drawing.lock().unwrap_or_else(PoisonError::into_inner);
        drawing.topologies.tidy();
        drawing
    }

    /// Draws all scenes and calls `read` with each batch in order; `fields` are those of
    /// `params`. A batch is gathered while the device draws the one before it.
    fn each<'a>(
        &self,
        scenes: &'a [Scene],
        params: Params,
        fields: &[f32],
        mut read: impl FnMut(&'a [Scene], &Batch<'a>, Drawn<'_>),
    ) {
        let mut drawing = self.lock();
        let can = drawing.send(5, fields).is_some();
        type Before<'a> = (&'a [Scene], Batch<'a>, usize, Option<Sent>);
        let mut before: Option<Before<'a>> = None;
        let (mut rest, mut slot) = (scenes, 0);
        loop {
            let next = (!rest.is_empty()).then(|| {
                let batch = drawing.batch(rest, &self.pool);
                let (own, after) = rest.split_at(batch.items.len());
                rest = after;
                slot = 1 - slot;
                let sent =
                    if can { drawing.submit(&batch, slot, params, &self.pool) } else { None };
                (own, batch, slot, sent)
            });
            if let Some((own, batch, slot, mut sent)) = before.take() {
                // True if there was room, and so everything was read.
                let mut collect = |sent: &Sent, drawing: &mut Drawing, is_last: bool| {
                    drawing.collect(sent, |drawn| {
                        let fits = is_last || !drawn.lacks_room();
                        if fits {
                            read(own, &batch, drawn);
                        }
                        fits
                    })
                };
                let mut done = sent.as_ref().and_then(|s| collect(s, &mut drawing, false));
                if done == Some(false) {
                    sent = drawing.submit(&batch, slot, params, &self.pool);
                    done = sent.as_ref().and_then(|s| collect(s, &mut drawing, true));
                }
                if done != Some(true) {
                    read(own, &batch, Drawn::default());
                }
            }
            if next.is_none() {
                break;
            }
            before = next;
        }
    }

    /// The CPU's results for the scenes that the device has not drawn, by number.
    fn left<T: Send>(
        &self,
        scenes: &[Scene],
        batch: &Batch<'_>,
        drawn: Drawn<'_>,
        draw: impl Fn(&Scene) -> T + Sync + Send,
    ) -> Vec<(usize, T)> {
        let is_left = |i: &usize| batch.for_cpu[*i] || drawn.outcome(*i).is_none();
        let left: Vec<usize> = (0..scenes.len()).filter(is_left).collect();
        self.by_cpu.fetch_add(left.len(), Ordering::Relaxed);
        if left.is_empty() { Vec::new() } else { self.pool.map(left, |i| (i, draw(&scenes[i]))) }
    }
}

impl Gpu {
    /// The contours of each scene, in the order given: as the CPU's within the tolerance that
    /// this crate states.
    pub fn contours(&self, scenes: &[Scene]) -> ContourBatch {
        let (mut out, mut end, all) = (ContourBatch::default(), 0, scenes.len());
        self.each(scenes, Params::default(), &[0.0], |scenes, batch, drawn| {
            let on_cpu = |scene: &Scene| Contours::of(&scene.solid, &scene.camera);
            let left = self.left(scenes, batch, drawn, on_cpu);
            let mut left = left.iter().peekable();
            let first = end;
            let part = |i: usize| {
                let part = match (left.next_if(|(of, _)| *of == i), drawn.outcome(i)) {
                    (None, Some(outcome)) => Part::Gpu(outcome.range()),
                    (of, _) => Part::Cpu(of.map(|(_, contours)| contours)),
                };
                end += part.len();
                out.ends.push(end);
                out.sizes.push(batch.size);
                part
            };
            let parts: Vec<Part<'_>> = (0..scenes.len()).map(part).collect();
            let each = end as f64 / out.ends.len() as f64;
            let likely = (1.05 * each * all as f64) as usize;
            write(&mut out, first..end, likely, drawn.lists, &parts, &self.pool);
        });
        lists(&mut out).into_iter().for_each(|list| list.truncate(end));
        out
    }
}

/// Where the pieces of a scene are.
enum Part<'a> {
    Gpu(Range<usize>),
    Cpu(Option<&'a Contours>),
}

impl Part<'_> {
    fn len(&self) -> usize {
        match self {
            Part::Gpu(range) => range.len(),
            Part::Cpu(contours) => contours.map_or(0, Contours::len),
        }
    }
}

fn lists(of: &mut ContourBatch) -> [&mut Vec<f32>; 5] {
    let ContourBatch { x, y, tx, ty, length, .. } = of;
    [x, y, tx, ty, length]
}

/// Writes the pieces of scenes to some places of the lists, on several cores. `written` are
/// the lists that the device wrote; `likely` is how many pieces there will be in the end.
fn write(
    out: &mut ContourBatch,
    to: Range<usize>,
    likely: usize,
    written: [&[f32]; 5],
    parts: &[Part<'_>],
    pool: &Pool,
) {
    let mut tasks = Vec::new();
    for (k, (out, list)) in lists(out).into_iter().zip(written).enumerate() {
        if to.start == 0 {
            // Zeros that cost nothing before they are overwritten.
            *out = vec![0.0; to.end.max(likely)];
        } else if out.len() < to.end {
            out.resize(to.end.max(likely), 0.0);
        }
        let mut rest = &mut out[to.clone()];
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
            match part {
                Part::Gpu(range) => own.copy_from_slice(&list[range.clone()]),
                Part::Cpu(Some(c)) => {
                    own.copy_from_slice([&c.x, &c.y, &c.tx, &c.ty, &c.length][k]);
                }
                Part::Cpu(None) => {}
            }
        }
    });
}
