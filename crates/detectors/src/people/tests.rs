//! Tests of windows, grouping of detections and consensus of views; and, with the
//! included networks, of a photograph.

use super::consensus::{PersonBox, Run, by_person, consensus, sure};
use super::landmarks::{NAMED, SIDE, SeenLandmark, View};
use super::window::{Beyond, Window};
use crate::nn::sigmoid;
use image::{Rgb, RgbImage};
use pcadlang_scene::vision::Photo;

fn near(a: [f64; 2], b: [f64; 2], by: f64) -> bool {
    (a[0] - b[0]).abs() < by && (a[1] - b[1]).abs() < by
}

#[test]
fn windows_lead_there_and_back() {
    let upright = Window { centre: [50.0, 30.0], side: 20.0, turn: 0.0, mirrored: false };
    assert!(near(upright.pixel([0.0, 0.0]), [40.0, 20.0], 1e-12));
    assert!(near(Window { mirrored: true, ..upright }.pixel([0.0, 0.0]), [60.0, 20.0], 1e-12));
    let quarter = Window { turn: std::f64::consts::FRAC_PI_2, ..upright };
    assert!(
        near(quarter.pixel([1.0, 0.5]), [50.0, 40.0], 1e-12),
        "right in the window is down in the picture"
    );
    for mirrored in [false, true] {
        let w = Window { turn: 0.7, mirrored, ..upright };
        for p in [[0.0, 0.0], [0.3, 0.9], [-2.0, 1.5]] {
            assert!(near(w.position(w.pixel(p)), p, 1e-12));
        }
    }
}

#[test]
fn the_window_of_a_person_is_turned_as_they_are() {
    let standing = Window::around([10.0, 50.0], [10.0, 30.0]);
    assert!(standing.turn.abs() < 1e-12 && (standing.side - 50.0).abs() < 1e-12);
    // Lying with the head to the right: up in the window is to the right in the picture.
    let lying = Window::around([10.0, 50.0], [30.0, 50.0]);
    assert!(near(lying.pixel([0.5, 0.0]), [35.0, 50.0], 1e-9));
    assert!(!Window::around([1.0, 1.0], [1.0, 1.0]).is_sound() && standing.is_sound());
}

fn sampled(w: Window, photo: &Photo, n: usize, range: [f32; 2], beyond: Beyond) -> Vec<f32> {
    let mut out = vec![7.0; 3 * n * n];
    w.sample(photo, n, range, beyond, &mut out);
    out
}

#[test]
fn samples_are_those_of_the_picture() {
    let photo =
        Photo::from_rgb(RgbImage::from_fn(8, 8, |x, y| Rgb([10 * x as u8, 10 * y as u8, 255])))
            .unwrap();
    let whole = Window::whole(8, 8, 0.0);
    let plain = sampled(whole, &photo, 8, [0.0, 255.0], Beyond::Black);
    for (i, p) in plain.chunks_exact(3).enumerate() {
        assert_eq!(p, [10.0 * (i % 8) as f32, 10.0 * (i / 8) as f32, 255.0]);
    }
    let turned = Window { mirrored: true, ..whole };
    let mirrored = sampled(turned, &photo, 8, [0.0, 255.0], Beyond::Edge);
    assert_eq!(mirrored[..3], [70.0, 0.0, 255.0], "the nearest pixel beyond the edge");
    assert_eq!(mirrored[3..6], [70.0, 0.0, 255.0]);
    let padded = sampled(Window::whole(8, 8, 0.5), &photo, 16, [-1.0, 1.0], Beyond::Black);
    assert_eq!(padded[..3], [-1.0; 3]);
    assert_eq!(padded[3 * (16 * 6 + 6) + 2], 1.0);
}

#[test]
fn samples_are_interpolated_and_beyond_the_picture_black_or_as_at_its_edge() {
    let reds = [[10, 20], [40, 80]];
    let rgb = RgbImage::from_fn(2, 2, |x, y| Rgb([reds[y as usize][x as usize], 0, 0]));
    let photo = Photo::from_rgb(rgb).unwrap();
    let red = |padding: f64, beyond: Beyond| -> Vec<f32> {
        let all = sampled(Window::whole(2, 2, padding), &photo, 4, [0.0, 255.0], beyond);
        all.into_iter().step_by(3).collect()
    };
    // Samples are half a pixel apart.
    let edge: [[f32; 4]; 4] = [
        [10.0, 15.0, 20.0, 20.0],
        [25.0, 37.5, 50.0, 50.0],
        [40.0, 60.0, 80.0, 80.0],
        [40.0, 60.0, 80.0, 80.0],
    ];
    let black: [[f32; 4]; 4] = [
        [10.0, 15.0, 20.0, 10.0],
        [25.0, 37.5, 50.0, 25.0],
        [40.0, 60.0, 80.0, 40.0],
        [20.0, 30.0, 40.0, 20.0],
    ];
    assert_eq!(red(0.0, Beyond::Edge), edge.as_flattened());
    assert_eq!(red(0.0, Beyond::Black), black.as_flattened());
    // Samples are a pixel apart, starting one pixel outside the picture.
    let (above, below): ([f32; 4], [f32; 4]) = ([10.0, 10.0, 20.0, 20.0], [40.0, 40.0, 80.0, 80.0]);
    assert_eq!(red(0.5, Beyond::Edge), [above, above, below, below].as_flattened());
    let black: [[f32; 4]; 4] = [[0.0; 4], [0.0, 10.0, 20.0, 0.0], [0.0, 40.0, 80.0, 0.0], [0.0; 4]];
    assert_eq!(red(0.5, Beyond::Black), black.as_flattened());
}

#[test]
fn masks_are_read_between_samples_up_to_the_last_ones() {
    let logit = |c: usize, r: usize| ((7 * c * c + 5 * r * r) % 13) as f32 - 6.0;
    let mask: Vec<f32> = (0..SIDE * SIDE).map(|i| logit(i % SIDE, i / SIDE)).collect();
    let at = |c: f64, r: f64| super::person::at(&mask, [c / SIDE as f64, r / SIDE as f64]);
    for c in [0, 1, 100, 254, 255] {
        for r in [0, 9, 254, 255] {
            assert_eq!(at(c as f64, r as f64), sigmoid(logit(c, r)), "{c} {r}");
        }
    }
    assert_eq!(at(254.5, 9.0), sigmoid(0.5 * (logit(254, 9) + logit(255, 9))));
    assert_eq!(at(9.0, 254.5), sigmoid(0.5 * (logit(9, 254) + logit(9, 255))));
    for (c, r) in [(-0.5, 9.0), (255.5, 9.0), (9.0, -0.5), (9.0, 255.5), (f64::NAN, 9.0)] {
        assert_eq!(at(c, r), 0.0, "{c} {r}");
    }
}

/// A view of a person with these hips and this length of the torso, with all landmarks
/// moved by some pixels.
fn run(hips: [f64; 2], torso: f64, moved: f64) -> Run {
    let at = |i: usize| {
        let (dx, up) = match i {
            11 | 12 => (0.2, 1.0),
            23 | 24 => (0.2, 0.0),
            _ => (0.1 * i as f64, 0.5),
        };
        let side = if i % 2 == 1 { 1.0 } else { -1.0 };
        [hips[0] + side * dx * torso + moved, hips[1] - up * torso]
    };
    let landmarks: [SeenLandmark; NAMED] = std::array::from_fn(|i| SeenLandmark {
        at: at(i),
        visibility: 0.5,
        metres: [moved, 0.0, i as f64],
    });
    let window = Window { centre: hips, side: 4.0 * torso, turn: 0.0, mirrored: false };
    let view = View { window, presence: 0.9, landmarks, next: window, mask: Vec::new() };
    Run { score: 0.8, in_box: None, found: window, view }
}

#[test]
fn runs_of_one_person_are_together() {
    let all = vec![
        run([100.0, 100.0], 40.0, 0.0),
        run([300.0, 100.0], 40.0, 0.0),
        run([104.0, 97.0], 42.0, 0.0),
        run([100.0, 100.0], 150.0, 0.0),
    ];
    let sizes: Vec<usize> = by_person(all, [400.0, 300.0]).iter().map(Vec::len).collect();
    assert_eq!(sizes, [2, 1, 1], "apart, and not of one size");
}

#[test]
fn whoever_fills_a_box_is_the_person_in_it() {
    let (size, here) = ([400.0, 300.0], run([100.0, 100.0], 40.0, 0.0));
    let bounds = here.view.bounds(size);
    let boxed = |score| Run { in_box: Some(PersonBox { bounds, score }), ..here.clone() };
    let all = vec![run([300.0, 100.0], 40.0, 0.0), here.clone(), boxed(Some(0.6))];
    let people = by_person(all, size);
    assert_eq!(people.iter().map(Vec::len).collect::<Vec<_>>(), [2, 1]);
    // A detector's score counts, half of it where the person is elsewhere; a user's box is
    // believed as far as landmarks are there, and the first network by half.
    let elsewhere = [0.0, 0.0, 1.0, 1.0];
    for (run, at, known) in [
        (boxed(Some(0.6)), bounds, 0.6),
        (boxed(Some(0.6)), elsewhere, 0.3),
        (boxed(None), elsewhere, 0.9),
        (here, bounds, 0.4),
    ] {
        assert_eq!(sure(&[run], at), known);
    }
}

#[test]
fn the_view_that_most_agree_with_counts() {
    let moved = [0.0, 1.0, 80.0, 2.0, 81.0];
    let runs: Vec<Run> = moved.iter().map(|m| run([100.0, 100.0], 40.0, *m)).collect();
    let c = consensus(&runs).unwrap();
    assert_eq!(c.agreeing, [0, 1, 3]);
    // Medians, and the standard deviation of a coordinate from them: the variance is (1 +
    // 0 + 1) / (2 * 3).
    assert!(
        (c.landmarks[0].at[0] - 101.0).abs() < 1e-9
            && (c.landmarks[0].metres[0] - 1.0).abs() < 1e-12
    );
    assert!((c.landmarks[0].spread - (2.0f64 / 6.0).sqrt()).abs() < 1e-9);
    assert_eq!((c.others.len(), c.others[0].views), (1, 2));
    assert!((c.others[0].landmarks[0].at[0] - 180.0).abs() < 1e-9, "the lower of two");
    // From a shoulder to the opposite hip.
    assert!((c.torso - 40.0 * (0.16f64 + 1.0).sqrt()).abs() < 1e-9);
    assert!(consensus(&[]).is_none());
}

#[test]
fn views_count_by_how_sure_they_are_that_they_see_someone() {
    let moved = [0.0, 1.0, 80.0, 81.0];
    for unsure in [0, 2] {
        for by_score in [false, true] {
            let mut runs: Vec<Run> = moved.iter().map(|m| run([100.0, 100.0], 40.0, *m)).collect();
            for r in &mut runs[unsure..unsure + 2] {
                *(if by_score { &mut r.score } else { &mut r.view.presence }) = 0.6;
            }
            let c = consensus(&runs).unwrap();
            assert_eq!(c.agreeing, [2 - unsure, 3 - unsure]);
        }
    }
}

mod shipped {
    use crate::people::{FindOptions, PeopleFinder, Person, Search};
    use pcadlang_scene::vision::{Limits, Photo, photo};

    fn finder() -> PeopleFinder {
        PeopleFinder::new(crate::weights::DETECTION, crate::weights::LANDMARKS).unwrap()
    }

    fn skier() -> Photo {
        let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../../examples/images/skier.jpg");
        photo::decode(&std::fs::read(path).unwrap(), &Limits::default()).unwrap()
    }

    /// All numbers of people, as bits.
    fn bits(people: &[Person]) -> Vec<u64> {
        let landmarks = people
            .iter()
            .flat_map(|p| p.landmarks)
            .flat_map(|l| [l.at[0], l.at[1], l.spread, l.metres[2]]);
        landmarks.map(f64::to_bits).collect()
    }

    #[test]
    fn a_skier_is_found_with_the_same_bits_on_any_number_of_threads() {
        let (finder, photo) = (finder(), skier());
        let options = FindOptions::default();
        let people = finder.find(&photo, Search::Everywhere(&[]), &options, 1);
        assert_eq!(bits(&people), bits(&finder.find(&photo, Search::Everywhere(&[]), &options, 2)));
        let [skier] = &people[..] else { panic!("{} people", people.len()) };
        let at = |name: &str| skier.landmark(name).unwrap().at;
        // COCO's annotation of this picture (CC BY 4.0, COCO Consortium).
        for (name, place) in [
            ("nose", [149.0, 81.0]),
            ("l_shoulder", [181.0, 108.0]),
            ("r_wrist", [91.0, 178.0]),
            ("r_knee", [149.0, 273.0]),
            ("l_ankle", [248.0, 362.0]),
            ("r_ankle", [178.0, 341.0]),
        ] {
            assert!(super::near(at(name), place, 12.0), "{name} {:?}", at(name));
        }
        assert!((60.0..140.0).contains(&skier.torso) && skier.views == 2 && skier.agreeing == 2);
        // One view is mirrored, so the two differ slightly.
        assert!(skier.landmarks.iter().any(|l| l.spread > 0.0));
        // The mask is on the person and off the snow.
        let mask = skier.mask(344, 425, 344);
        let chest = ["l_shoulder", "r_hip"].map(at);
        let middle = [0, 1].map(|k| 0.5 * (chest[0][k] + chest[1][k]));
        assert!(mask[middle[1] as usize * 344 + middle[0] as usize] > 0.9);
        assert!(mask[400 * 344 + 20] < 0.1 && mask.len() == 344 * 425);
    }

    #[test]
    fn nobody_is_found_where_there_is_nobody() {
        let grey =
            Photo::from_rgb(image::RgbImage::from_pixel(300, 200, image::Rgb([128; 3]))).unwrap();
        let dot = Photo::from_rgb(image::RgbImage::new(1, 1)).unwrap();
        let wide =
            Photo::from_rgb(image::RgbImage::from_pixel(16_000, 3, image::Rgb([90, 20, 200])))
                .unwrap();
        for photo in [grey, dot, wide] {
            assert!(
                finder()
                    .find(&photo, Search::Everywhere(&[]), &FindOptions::default(), 1)
                    .is_empty()
            );
        }
    }

    #[test]
    fn a_network_for_something_else_is_refused() {
        let exchanged =
            PeopleFinder::new(crate::weights::LANDMARKS, crate::weights::DETECTION).unwrap_err();
        assert!(exchanged.to_string().contains("it is not a person detector"), "{exchanged}");
        assert!(PeopleFinder::new(b"", crate::weights::LANDMARKS).is_err());
    }
}
