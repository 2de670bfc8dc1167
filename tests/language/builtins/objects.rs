//! `scene.objects`: what it returns of a photograph, and what it refuses.

use super::*;
use pcadlang_library::scene::ImageValue;
use pcadlang_scene::vision::photo;

fn skier() -> Value {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/examples/images/skier.jpg");
    let photo = photo::decode(&std::fs::read(path).unwrap(), &Default::default()).unwrap();
    Value::object(ImageValue::photo(photo))
}

fn words(all: &[&str]) -> Value {
    Value::List(all.iter().map(|w| Value::str(w)).collect())
}

/// Returns the classes and scores of objects.
fn described(found: &Value) -> Vec<(String, f64)> {
    let Value::List(all) = found else { panic!("{found}") };
    let one = |o: &Value| {
        let Value::Record(fields) = o else { panic!("{o}") };
        let Value::Num(score) = fields["score"] else { panic!("{o}") };
        let Value::Str(class) = &fields["class"] else { panic!("{o}") };
        (class.to_string(), score)
    };
    all.iter().map(one).collect()
}

#[test]
fn objects_have_a_box_a_class_and_a_score() {
    let photo = skier();
    let of = |most: f64, least: f64, classes: Value| {
        call("scene.objects", &[photo.clone(), num(most), num(least), classes])
    };
    let usual = call("scene.objects", std::slice::from_ref(&photo));
    let all = described(&usual);
    assert!(all[0].0 == "person" && all[0].1 > 0.8, "{all:?}");
    assert!(all.iter().all(|(_, score)| *score >= 0.3));
    let Value::List(found) = &usual else { panic!() };
    let Value::Record(first) = &found[0] else { panic!() };
    let Value::Array(place) = &first["box"] else { panic!("{}", found[0]) };
    for (got, expected) in place.iter().zip([62.0, 44.0, 215.0, 348.0]) {
        assert!((got - expected).abs() < 10.0, "{place:?}");
    }
    // More with a lower score, the best first; fewer at most; of some classes only.
    let more = described(&of(100.0, 0.1, list(&[])));
    assert!(more.len() > all.len() && more[..all.len()] == all[..]);
    assert!(more.windows(2).all(|w| w[0].1 >= w[1].1));
    assert_eq!(described(&of(1.0, 0.1, list(&[]))), more[..1]);
    let skis = described(&of(2.0, 0.1, words(&["skis", "snowboard"])));
    assert_eq!(skis.len(), 2);
    assert!(skis.iter().all(|(class, _)| class == "skis" || class == "snowboard"));
    // A contour map has none.
    let map = Value::object(ImageValue::default());
    assert!(described(&call("scene.objects", &[map])).is_empty());
}

#[test]
fn unknown_classes_are_refused() {
    let with = |classes| fails("scene.objects", &[skier(), num(1.0), num(0.5), classes]);
    let near = with(words(&["cup", "wineglass"]));
    assert_eq!(near, "scene.objects: there is no class \"wineglass\" (did you mean `wine glass`?)");
    assert!(with(words(&["xylophone"])).contains("(the classes are person, bicycle, car, "));
    assert!(with(list(&[num(1.0), Value::Bool(true)])).contains("names of classes"));
    assert!(with(Value::str("cup")).contains("`classes` must be an array of names of classes"));
    let low = fails("scene.objects", &[skier(), num(1.0), num(0.0)]);
    assert!(low.contains("`least` must be"), "{low}");
}
