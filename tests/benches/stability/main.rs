//! Temporal stability while the light or the camera moves: the plugin against `naive-rsm`.
//!
//! `make bench BENCH=stability ARGS='…'`: `[--size WxH] [--spp N] [--count FRAMES] [light |
//! camera | both | disocclusion | MAP.ron]…`
//!
//! `courtyard` with only its sun and without textures, after 32 frames of the same motion. Temporal
//! error: mean over successive frames, pixels and channels of |Δframe − Δreference| ÷ mean of the
//! reference. The reference is path-traced with the same random numbers in every frame, so that
//! most of its noise cancels in the differences. A second seed measures the remaining noise; the
//! reference is the mean of both. Along surfaces: the same over pixels that show the same surface
//! in both frames. At other pixels the difference is one between two surfaces, and depends on where
//! edges cross pixels. Error of the first and the last frame: relative L1 of 4x4 means; that of the
//! last includes the lag of temporal accumulation. The last row is at rest in every frame: its error
//! is in the images themselves, none of it noise or lag.
//!
//! Disocclusion: the camera goes half a metre in five frames and stays. Error of the pixels that show
//! another surface than before, relative L1 against the path-traced image, by frames after that.
//!
//! A map of `courtyard`: temporal error in the frames after every switch between two of its settings.

mod disocclusion;
mod moving;
mod steps;
mod switches;

use std::path::Path;

use bevy::math::UVec2;
use frugal::stage::adapter;
use frugal_tests::arguments::Arguments;

use crate::moving::Motion;

fn main() {
    let Some(adapter) = adapter() else {
        println!("no graphics adapter: nothing is measured");
        return;
    };
    let options =
        Arguments { size: UVec2::new(96, 54), samples: 256, count: 8, names: vec![] }.read();
    println!(
        "Adapter: {}. `courtyard`, sun alone, no textures, {}x{}, {} steps.\n",
        adapter.name, options.size.x, options.size.y, options.count
    );
    for (motion, name, moving) in [
        (Motion::Light, "light", "The light moves"),
        (Motion::Camera, "camera", "The camera moves"),
        (Motion::Both, "both", "Both move"),
    ] {
        if options.wants(name) {
            steps::measure(motion, moving, &options);
        }
    }
    if options.wants("disocclusion") {
        disocclusion::disocclude(&options);
    }
    if let Some(map) = options.names.iter().find(|name| name.ends_with(".ron")) {
        switches::measure(Path::new(map), &options);
    }
}
