//! `pcadlang detect`.

use clap::Args;
use image::RgbImage;
use pcadlang_detectors::boxes::sides;
use pcadlang_detectors::objects::{self, FoundObject, ObjectFinder, ObjectOptions, View};
use pcadlang_detectors::people::{FindOptions, Person, Search, VIEWS_OF_PEOPLE, json};
use pcadlang_report::pictures::{DETECTED, dots, limbs, picture_size, png, scaled};
use pcadlang_runs::failure::{Failure, plain};
use pcadlang_runs::hint::rectangle;
use pcadlang_runs::{files, inputs};
use pcadlang_scene::vision::Photo;
use std::path::{Path, PathBuf};

/// `detect`.
#[derive(Args, Debug)]
pub struct Detect {
    /// The photograph
    #[arg(value_name = "IMG")]
    pub image: PathBuf,
    /// Detect objects of COCO's 80 classes instead of people, and write boxes as COCO annotations
    #[arg(long, conflicts_with_all = ["format", "models", "views", "people", "threads"])]
    pub objects: bool,
    /// The file to write to [default: people.json, readable by `--keypoints`, or objects.json]
    #[arg(short, long, value_name = "FILE")]
    pub out: Option<PathBuf>,
    /// The layout of people
    #[arg(long, value_enum, default_value_t = PeopleFormat::Coco)]
    pub format: PeopleFormat,
    /// The number of the picture in a dataset of COCO's layout
    #[arg(long, value_name = "N", default_value_t = 1)]
    pub image_id: u64,
    /// Draw what was detected over the photograph, to this file
    #[arg(long, value_name = "PNG")]
    pub overlay: Option<PathBuf>,
    /// A folder with networks: pose_detection.tflite, pose_landmark_heavy.tflite, …_full
    /// or …_lite
    #[arg(long, value_name = "DIR")]
    pub models: Option<PathBuf>,
    /// The number of views of the picture: with increasing padding, each also mirrored
    #[arg(long, default_value_t = 2, value_parser = clap::value_parser!(u32).range(2..=8))]
    pub views: u32,
    /// Look only for the person who fills this box, in pixels of the photograph
    #[arg(
        long = "box", value_name = "X,Y,W,H", allow_hyphen_values = true,
        value_parser = rectangle, conflicts_with = "objects"
    )]
    pub bounds: Option<[f64; 4]>,
    /// The maximum number of people per view
    #[arg(long, default_value_t = 20, value_parser = clap::value_parser!(u32).range(1..=100))]
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

/// The colours of boxes, in the order of objects.
const COLORS: [(&str, [f32; 3]); 6] = [
    ("red", [230.0, 60.0, 50.0]),
    ("green", [60.0, 200.0, 90.0]),
    ("blue", [70.0, 130.0, 255.0]),
    ("yellow", [250.0, 210.0, 50.0]),
    ("magenta", [230.0, 80.0, 220.0]),
    ("cyan", [70.0, 220.0, 230.0]),
];

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

/// Detects the people or objects in a photograph and writes their positions.
pub fn detect(a: &Detect) -> Result<(), Failure> {
    let photo = inputs::photo(&a.image)?;
    if a.objects { detect_objects(a, &photo) } else { detect_people(a, &photo) }
}

fn detect_people(a: &Detect, photo: &Photo) -> Result<(), Failure> {
    let options = FindOptions { views: a.views, most: a.people as usize, ..FindOptions::default() };
    let wide = ObjectOptions { most: usize::MAX, ..ObjectOptions::default() };
    let objects = match a.bounds {
        Some(_) => Vec::new(),
        None => objects_in(photo, VIEWS_OF_PEOPLE, &wide)?,
    };
    let within = a.bounds.map(|b| Search::Within(sides(b)));
    let search = within.unwrap_or(Search::Everywhere(&objects));
    let people = inputs::finder(a.models.as_deref())?.find(photo, search, &options, a.threads);
    let size = (photo.width(), photo.height());
    let file = match a.format {
        PeopleFormat::Coco => json::coco(&people, size, &name(a), a.image_id),
        PeopleFormat::Mediapipe => json::mediapipe(&people, size),
    };
    write(a, "people.json", &format!("{file:#}\n"), || overlay(photo, &people))?;
    print_line!("{}", found(&people));
    for (i, p) in people.iter().enumerate() {
        print_line!("{}", line(i + 1, p, size));
    }
    Ok(())
}

/// Detects the objects in a photograph, and lists them with the colours of their boxes.
fn detect_objects(a: &Detect, photo: &Photo) -> Result<(), Failure> {
    let found = objects_in(photo, &[View::WHOLE], &ObjectOptions::default())?;
    let file = objects::json::coco(&found, (photo.width(), photo.height()), &name(a), a.image_id);
    write(a, "objects.json", &format!("{file:#}\n"), || boxes(photo, &found))?;
    match found.len() {
        0 => print_line!("no objects were found"),
        1 => print_line!("1 object"),
        n => print_line!("{n} objects, the highest score first"),
    }
    for (i, (o, (color, _))) in found.iter().zip(COLORS.iter().cycle()).enumerate() {
        let [left, top, right, bottom] = o.bounds.map(|x| x.round());
        print_line!(
            "{}: {}, {:.0}%: x {left} to {right}, y {top} to {bottom} ({color})",
            i + 1,
            o.name(),
            100.0 * o.score
        );
    }
    Ok(())
}

fn objects_in(
    photo: &Photo,
    views: &[View],
    options: &ObjectOptions,
) -> Result<Vec<FoundObject>, Failure> {
    ObjectFinder::included().find_in_views(photo, views, options).map_err(|e| plain(e.to_string()))
}

/// The photograph's name without its folder.
fn name(a: &Detect) -> String {
    a.image.file_name().unwrap_or_default().to_string_lossy().into_owned()
}

/// Writes what was detected, and the overlay if one is wanted.
fn write(
    a: &Detect,
    usual: &str,
    text: &str,
    overlay: impl FnOnce() -> RgbImage,
) -> Result<(), Failure> {
    files::write(a.out.as_deref().unwrap_or(Path::new(usual)), text.as_bytes())?;
    if let Some(path) = &a.overlay {
        files::write(path, &png(&overlay()).map_err(|e| plain(e.to_string()))?)?;
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

/// The photograph at the size of pictures.
fn base(photo: &Photo) -> RgbImage {
    let (width, height) = picture_size(photo.width(), photo.height());
    scaled(photo.rgb(), width, height)
}

/// Draws the boxes of objects over the photograph, the best on top.
fn boxes(photo: &Photo, objects: &[FoundObject]) -> RgbImage {
    let size = (photo.width(), photo.height());
    let mut out = base(photo);
    let colored: Vec<_> = objects.iter().zip(COLORS.iter().cycle()).collect();
    for (o, (_, color)) in colored.into_iter().rev() {
        let [l, t, r, b] = o.bounds;
        let sides = [[[l, t], [r, t]], [[r, t], [r, b]], [[r, b], [l, b]], [[l, b], [l, t]]];
        limbs(&mut out, size, &sides, *color);
    }
    out
}

/// Draws people over the photograph: the left side green, the right side red.
fn overlay(photo: &Photo, people: &[Person]) -> RgbImage {
    let size = (photo.width(), photo.height());
    let mut out = base(photo);
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
