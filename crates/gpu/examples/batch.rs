//! Measures scenes a second on the GPU beside all cores of the CPU, and how far the two
//! differ.
//!
//!     cargo run --release --example batch -- [SCENES [SIZE [REPEATS]]]
//!
//! Such as `256,4096 128 7`. For each shape and number of scenes: scenes a second with
//! contours that are read back, and with scores against one picture, for which they are
//! not. Each is the best of several calls; the scenes exist before. Then the differences
//! of the contours and of their distances from the picture.

#[path = "../tests/scenes/mod.rs"]
mod scenes;

use pcadlang_gpu::{ContourBatch, Cores, Gpu, Scene};
use pcadlang_numerics::platform::threads::Pool;
use pcadlang_scene::geom::{Caps, Solid};
use pcadlang_scene::render::Contours;
use pcadlang_scene::vision::{Chamfer, ChamferOptions, ContourMap};
use scenes::Spread;
use std::error::Error;
use std::time::{Duration, Instant};

type Made = Result<Solid, Box<dyn Error>>;
/// Makes the object of a scene, somewhere in its picture.
type Make<'a> = &'a mut dyn FnMut(usize, &mut Spread) -> Made;

fn main() -> Result<(), Box<dyn Error>> {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let numbers = |i: usize, other: &str| -> Result<Vec<usize>, std::num::ParseIntError> {
        args.get(i).map_or(other, String::as_str).split(',').map(str::parse).collect()
    };
    let (counts, sizes, repeats) = (numbers(0, "256,4096")?, numbers(1, "128")?, numbers(2, "7")?);
    let gpu = Gpu::new()?;
    let threads = std::thread::available_parallelism()?;
    println!("{} beside {threads} threads", gpu.name());
    let (body, cup) = (scenes::human()?, scenes::lathe(1, 40, 0.0, Caps::Both)?);
    let still = body.posed(&[], &Default::default())?;
    // Closed forms are divided into other pieces than meshes are, so theirs are compared by
    // less than a piece's length.
    let shapes: [(&str, f32, Make<'_>); 4] = [
        ("lathe, other profiles", 0.8, &mut |i, random| {
            Ok(scenes::lathe(i as u64, 0, 0.0, Caps::Both)?.placed(random.placement()))
        }),
        ("lathe of 40 sides, other places", 0.02, &mut |_, random| {
            Ok(cup.placed(random.placement()))
        }),
        ("body, other places", 0.02, &mut |_, random| Ok(scenes::set(&still, random))),
        ("body, other poses", 0.02, &mut |_, random| scenes::posed(&body, random)),
    ];
    for (name, near, make) in shapes {
        for size in &sizes {
            for count in &counts {
                let scenes = scenes::scenes(*count, *size as u32, &mut *make)?;
                measure(&gpu, &format!("{name}, {size} pixels"), &scenes, near, repeats[0])?;
            }
        }
    }
    Ok(())
}

fn measure(
    gpu: &Gpu,
    name: &str,
    scenes: &[Scene],
    near: f32,
    repeats: usize,
) -> Result<(), Box<dyn Error>> {
    let (cores, pool) = (Cores::new(0), Pool::new(0));
    let chamfer = observed(&scenes[0])?;
    let score = |s: &Scene| chamfer.log_likelihood(&Contours::of(&s.solid, &s.camera).slice());
    let before = gpu.drawn_by_cpu();
    let (ours, [drawn, scored]) = (
        gpu.contours(scenes),
        [
            best(repeats, scenes, || drop(gpu.contours(scenes))),
            best(repeats, scenes, || drop(gpu.log_likelihoods(scenes, &chamfer))),
        ],
    );
    let by_cpu = gpu.drawn_by_cpu() - before;
    let wanted = cores.contours(scenes);
    let cpu_drawn = best(repeats, scenes, || drop(cores.contours(scenes)));
    let cpu_scored = best(repeats, scenes, || drop(pool.map(scenes.iter().collect(), score)));
    println!("{name}, {} scenes, {:.0} pieces each:", scenes.len(), mean_pieces(&wanted));
    println!(
        "  contours: GPU {drawn:.0} a second, CPU {cpu_drawn:.0}, {:.2} times",
        drawn / cpu_drawn
    );
    println!(
        "  scores:   GPU {scored:.0} a second, CPU {cpu_scored:.0}, {:.2} times",
        scored / cpu_scored
    );
    let few = scenes.len().min(256);
    let alike =
        scenes::compare(&gpu.contours(&scenes[..few]), &cores.contours(&scenes[..few]), near);
    println!(
        "  alone: {:.5} of the length; the others are within {:.5} pixels, {:.7} in the mean",
        alike.share(),
        alike.farthest,
        alike.mean
    );
    let rho = |c: &ContourBatch, i: usize| {
        let slice = c.scene(i);
        chamfer.distance(&slice) * slice.diagonal() / 100.0
    };
    let mut off: Vec<f64> =
        (0..scenes.len()).map(|i| (rho(&ours, i) - rho(&wanted, i)).abs()).collect();
    off.sort_by(f64::total_cmp);
    let mean = off.iter().sum::<f64>() / off.len() as f64;
    let at = |share: f64| off[(off.len() as f64 * share) as usize];
    println!(
        "  distance off by {mean:.5} pixels in the mean, {:.5} at the 99th percentile, {:.5} at most",
        at(0.99),
        off[off.len() - 1]
    );
    println!("  drawn by the CPU: {by_cpu}; trouble: {:?}", gpu.error());
    Ok(())
}

/// What the first scene shows, as a picture's contours.
fn observed(scene: &Scene) -> Result<Chamfer, Box<dyn Error>> {
    let seen = Contours::of(&scene.solid, &scene.camera);
    let map = ContourMap::of(&seen.slice());
    Ok(Chamfer::prepare(&map, seen.width, seen.height, &ChamferOptions::default())?)
}

fn mean_pieces(batch: &ContourBatch) -> f64 {
    batch.x.len() as f64 / batch.len().max(1) as f64
}

/// The clock of an idle GPU is low, and takes this long to rise.
const WARM: Duration = Duration::from_millis(700);

/// Scenes a second, in the best of several calls after it has warmed up.
fn best(repeats: usize, scenes: &[Scene], mut call: impl FnMut()) -> f64 {
    let begun = Instant::now();
    while begun.elapsed() < WARM {
        call();
    }
    let times = (0..repeats.max(1)).map(|_| {
        let begun = Instant::now();
        call();
        begun.elapsed().as_secs_f64()
    });
    scenes.len() as f64 / times.fold(f64::INFINITY, f64::min)
}
