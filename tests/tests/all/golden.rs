//! Golden images, and a test that their comparison can fail.

use std::collections::BTreeSet;

use bevy::math::Vec3;
use frugal_tests::{golden, set};
use frugal_trace::metrics::Picture;

tests!(images_match_their_references, a_different_image_is_detected, every_reference_has_a_view);

struct View {
    name: &'static str,
    scene: &'static str,
    eye: Vec3,
    target: Vec3,
}

const VIEWS: [View; 3] = [
    View {
        name: "cornell",
        scene: "cornell",
        eye: Vec3::new(0.0, 2.74, 7.8),
        target: Vec3::new(0.0, 2.74, 0.0),
    },
    View {
        name: "two_rooms_lit",
        scene: "two_rooms",
        eye: Vec3::new(-0.8, 1.7, 2.0),
        target: Vec3::new(-3.2, 1.0, -1.6),
    },
    View {
        name: "two_rooms_dark",
        scene: "two_rooms",
        eye: Vec3::new(0.8, 1.7, 2.0),
        target: Vec3::new(3.2, 1.0, -1.6),
    },
];

fn render(view: &View) -> Picture {
    let mut stage = set::open(&set::scene(view.scene), set::options(64, 36));
    set::look(&mut stage, view.eye, view.target);
    set::apply(
        &mut stage,
        "max,rsm_resolution=128,gi_vpl_count=256,shadow_map_resolution=512,post_processing=off",
    );
    stage.get_ready().expect("a ready stage");
    stage.picture().expect("an image")
}

fn images_match_their_references() {
    let results = VIEWS
        .iter()
        .map(|view| (view.name, golden::compare(&golden::folder(), view.name, &render(view))));
    let mut faults = Vec::new();
    for (name, result) in results {
        match result {
            Ok(error) => println!("    {name}: error {error:.5}"),
            Err(fault) => faults.push(fault),
        }
    }
    assert!(faults.is_empty(), "{}", faults.join("\n"));
}

fn a_different_image_is_detected() {
    let folder = golden::folder();
    let reference = Picture::read_png(&folder.join("cornell.png")).expect("the reference");
    let at = |x: u32, y: u32| reference.rgb[(y * reference.width + x) as usize];
    let shifted =
        Picture::from_fn(reference.width, reference.height, |x, y| at(x.saturating_sub(1), y));
    let dimmed =
        Picture::from_fn(reference.width, reference.height, |x, y| at(x, y).map(|value| value / 2));
    let other = Picture::read_png(&folder.join("two_rooms_lit.png")).expect("the reference");
    let smaller = Picture::from_fn(8, 8, |_, _| [0; 3]);
    if std::env::var_os(golden::BLESS).is_none() {
        for (label, image) in
            [("shifted", shifted), ("dimmed", dimmed), ("other", other), ("smaller", smaller)]
        {
            let fault = golden::compare(&folder, "cornell", &image).expect_err(label);
            assert!(
                fault.contains("golden-cornell-actual.png") && fault.contains(golden::BLESS),
                "{label}: {fault}"
            );
        }
        let missing = golden::compare(&folder, "no_such_view", &reference).expect_err("missing");
        assert!(missing.contains("no reference"), "{missing}");
        assert!(golden::compare(&folder, "cornell", &reference).is_ok());
    }
}

fn every_reference_has_a_view() {
    let files = std::fs::read_dir(golden::folder()).expect("a folder");
    let files: BTreeSet<String> = files
        .map(|file| file.expect("a file").file_name().to_string_lossy().into_owned())
        .collect();
    let views: BTreeSet<String> = VIEWS.iter().map(|view| format!("{}.png", view.name)).collect();
    assert_eq!(files, views, "files in tests/golden against the rendered views");
}
