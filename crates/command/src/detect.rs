//! `pcadlang detect`.

use clap::Args;
use image::RgbImage;
use pcadlang_detectors::people::{FindOptions, Person, json};
use pcadlang_report::pictures::{DETECTED, dots, limbs, picture_size, png};
use pcadlang_runs::failure::{Failure, plain};
use pcadlang_runs::{files, inputs};
use pcadlang_scene::vision::Photo;
use std::path::PathBuf;

/// `detect`.
#[derive(Args, Debug)]
pub struct Detect {
    /// The photograph
    #[arg(value_name = "IMG")]
    pub image: PathBuf,
    /// The file to write the people to, readable by `--keypoints`
    #[arg(short, long, value_name = "FILE", default_value = "people.json")]
    pub out: PathBuf,
    /// Its layout
    #[arg(long, value_enum, default_value_t = PeopleFormat::Coco)]
    pub format: PeopleFormat,
    /// Draw the people over the photograph, to this file
    #[arg(long, value_name = "PNG")]
    pub overlay: Option<PathBuf>,
    /// A folder with networks: pose_detection.tflite, pose_landmark_heavy.tflite, …_full
    /// or …_lite
    #[arg(long, value_name = "DIR")]
    pub models: Option<PathBuf>,
    /// The number of views of the picture: with increasing padding, each also mirrored
    #[arg(long, default_value_t = 2, value_parser = clap::value_parser!(u32).range(2..=8))]
    pub views: u32,
    /// The maximum number of people per view
    #[arg(long, default_value_t = 2, value_parser = clap::value_parser!(u32).range(1..=100))]
    pub people: u32,
    /// The number of threads; 0 means all cores
    #[arg(long, default_value_t = 0)]
    pub threads: usize,
}

/// How people are written.
#[derive(clap::ValueEnum, Clone, Copy, Debug, PartialEq, Eq)]
pub enum PeopleFormat {
    /// COCO annotations, with all landmarks added
    Coco,
    /// MediaPipe's 33 landmarks, as fractions of the picture's sides
    Mediapipe,
}

/// The landmarks at the two ends of a bone.
type Bone = (&'static str, &'static str);

/// The bones of the left side, of the right side, and between them, with their colours.
const BONES: [(&[Bone], [f32; 3]); 3] = [
    (
        &[
            ("l_shoulder", "l_elbow"),
            ("l_elbow", "l_wrist"),
            ("l_wrist", "l_index"),
            ("l_shoulder", "l_hip"),
            ("l_hip", "l_knee"),
            ("l_knee", "l_ankle"),
            ("l_ankle", "l_foot_index"),
        ],
        [60.0, 200.0, 90.0],
    ),
    (
        &[
            ("r_shoulder", "r_elbow"),
            ("r_elbow", "r_wrist"),
            ("r_wrist", "r_index"),
            ("r_shoulder", "r_hip"),
            ("r_hip", "r_knee"),
            ("r_knee", "r_ankle"),
            ("r_ankle", "r_foot_index"),
        ],
        [230.0, 70.0, 60.0],
    ),
    (&[("l_shoulder", "r_shoulder"), ("l_hip", "r_hip")], [240.0, 240.0, 240.0]),
];

/// Detects the people in a photograph and writes their positions.
pub fn detect(a: &Detect) -> Result<(), Failure> {
    let photo = inputs::photo(&a.image)?;
    let options = FindOptions { views: a.views, most: a.people as usize, ..FindOptions::default() };
    let people = inputs::finder(a.models.as_deref())?
        .find(&photo, &options, a.threads)
        .map_err(|e| plain(e.to_string()))?;
    let size = (photo.width(), photo.height());
    let name = a.image.file_name().unwrap_or_default().to_string_lossy();
    let file = match a.format {
        PeopleFormat::Coco => json::coco(&people, size, &name),
        PeopleFormat::Mediapipe => json::mediapipe(&people, size),
    };
    files::write(&a.out, format!("{file:#}\n").as_bytes())?;
    if let Some(path) = &a.overlay {
        files::write(path, &png(&overlay(&photo, &people)).map_err(|e| plain(e.to_string()))?)?;
    }
    print_line!("{}", found(&people));
    for (i, p) in people.iter().enumerate() {
        print_line!("{}", line(i + 1, p, size));
    }
    Ok(())
}

fn found(people: &[Person]) -> String {
    match people.len() {
        0 => "no people were found".into(),
        1 => "1 person".into(),
        n => format!("{n} people, the most prominent first"),
    }
}

fn line(number: usize, p: &Person, (width, height): (u32, u32)) -> String {
    let [left, top, right, bottom] = p.bounds.map(|x| x.round());
    let inside = |l: &[f64; 2]| {
        (0.0..f64::from(width)).contains(&l[0]) && (0.0..f64::from(height)).contains(&l[1])
    };
    let seen = p.landmarks.iter().filter(|l| inside(&l.at)).count();
    let others = match p.others.len() {
        0 => String::new(),
        1 => ", another pose".into(),
        n => format!(", {n} other poses"),
    };
    format!(
        "{number}: x {left} to {right}, y {top} to {bottom}; {seen} of {} landmarks in the \
         picture; {} of {} views agree{others}; {:.0}% confidence",
        p.landmarks.len(),
        p.agreeing,
        p.views,
        100.0 * p.sure
    )
}

/// Draws people over the photograph: the left side green, the right side red.
fn overlay(photo: &Photo, people: &[Person]) -> RgbImage {
    let size = (photo.width(), photo.height());
    let (width, height) = picture_size(size.0, size.1);
    let mut out =
        image::imageops::resize(photo.rgb(), width, height, image::imageops::FilterType::Triangle);
    for p in people {
        for (bones, color) in BONES {
            let ends: Vec<_> = bones
                .iter()
                .filter_map(|(a, b)| Some([p.landmark(a)?.at, p.landmark(b)?.at]))
                .collect();
            limbs(&mut out, size, &ends, color);
        }
        dots(&mut out, size, &p.landmarks.map(|l| l.at), DETECTED);
    }
    out
}
