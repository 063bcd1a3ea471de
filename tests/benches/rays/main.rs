//! What rays cost: loads of nodes by a ray, rounds and triangle tests of a wave, by replay through the
//! shipped traversal over the trees on the graphics adapter.
//!
//! `make bench BENCH=rays ARGS='[--size WxH] [SCENE@SECONDS]…'`: a view is a scene of the repository, or a
//! scene file, and a time of its tour; the size is that of the image of low-resolution pixels. Rays go
//! from them to the VPLs of the default settings, chosen as the gather chooses, and to a sky that is as
//! bright everywhere. A wave is 64 pixels of one VPL set. Each answer is compared with that of the path
//! tracer, which has a tree of its own.

mod drawn;
mod replay;

use std::collections::HashMap;

use bevy::math::{UVec2, Vec3};
use drawn::Image;
use frugal::scene::SceneDescription;
use frugal::stage::adapter;
use frugal_tests::arguments::Arguments;
use frugal_tests::table::markdown;
use frugal_tests::{reference, set};
use frugal_trace::integrator::surfaces;
use frugal_trace::scene::{AlphaMode, Hit, RayScene, SceneGeometry, SceneMesh};
use replay::{Ray, Replay, WAVE, WORDS};

/// Waves of a dispatch.
const BATCH: usize = 256;

fn main() {
    if adapter().is_none() {
        println!("no graphics adapter: nothing is measured");
        return;
    }
    let options =
        Arguments { size: UVec2::new(480, 256), samples: 0, count: 0, names: vec![] }.read();
    let views = match options.names.as_slice() {
        [] => vec!["courtyard@0", "courtyard@4", "hall@0"],
        names => names.iter().map(String::as_str).collect(),
    };
    let mut rows = Vec::new();
    for view in views {
        let (scene, seconds) = reference::view(view);
        let name = view.rsplit('/').next().unwrap_or(view);
        for (kind, counts) in measure(&scene, seconds, options.size) {
            rows.push(counts.row(name, kind));
            println!("{:?}", rows.last());
        }
    }
    let head = [
        "view",
        "rays to",
        "rays",
        "occluded",
        "nodes over instances a ray",
        "nodes of meshes a ray",
        "triangle tests a ray",
        "node rounds a wave",
        "triangle rounds a wave",
        "answers unlike the tracer's",
    ];
    println!("{}", markdown(&head, &rows));
}

/// Sums over rays and waves.
#[derive(Default)]
struct Counts {
    rays: u64,
    occluded: u64,
    /// Loads of nodes over instances.
    tops: u64,
    /// Loads of nodes of meshes.
    loads: u64,
    tests: u64,
    waves: u64,
    wave_loads: u64,
    wave_tests: u64,
    unlike: u64,
    too_long: u64,
}

impl Counts {
    fn row(&self, view: &str, kind: &str) -> Vec<String> {
        assert_eq!(self.too_long, 0, "a ray has more rounds than its log holds");
        let by = |sum: u64, of: u64| format!("{:.1}", sum as f64 / of.max(1) as f64);
        vec![
            view.to_owned(),
            kind.to_owned(),
            self.rays.to_string(),
            format!("{:.2}", self.occluded as f64 / self.rays.max(1) as f64),
            by(self.tops, self.rays),
            by(self.loads, self.rays),
            by(self.tests, self.rays),
            by(self.wave_loads, self.waves),
            by(self.wave_tests, self.waves),
            self.unlike.to_string(),
        ]
    }

    /// Adds a wave: its rays, and their logs.
    fn add(&mut self, rays: &[Ray], logs: &[u32], truth: &Truth) {
        let mut rounds: HashMap<u32, [u32; 2]> = HashMap::new();
        let mut tops = 0;
        for (ray, log) in rays.iter().zip(logs.chunks_exact(WORDS)) {
            let Some([origin, end]) = ray else { continue };
            let (occluded, count) = (log[0] & 1 == 1, (log[0] >> 1) as usize);
            self.too_long += u64::from(2 * count > WORDS - 2);
            self.rays += 1;
            self.occluded += u64::from(occluded);
            self.unlike +=
                u64::from(truth.is_occluded(*origin, *end).is_some_and(|truth| truth != occluded));
            self.tops += u64::from(log[1]);
            tops = tops.max(log[1]);
            for round in log[2..].chunks_exact(2).take(count) {
                let (loads, tests) = (round[1] >> 16, round[1] & 0xffff);
                self.loads += u64::from(loads);
                self.tests += u64::from(tests);
                let most = rounds.entry(round[0]).or_default();
                *most = [most[0].max(loads), most[1].max(tests)];
            }
        }
        if rays.iter().any(Option::is_some) {
            self.waves += 1;
            self.wave_loads += u64::from(tops);
            for [loads, tests] in rounds.into_values() {
                self.wave_loads += u64::from(loads);
                self.wave_tests += u64::from(tests);
            }
        }
    }
}

/// The path tracer's triangles.
struct Truth {
    rays: RayScene,
    /// By mesh: whether its material has an alpha mask.
    is_masked: Vec<bool>,
}

impl Truth {
    fn new(geometry: &SceneGeometry) -> Self {
        let is_masked =
            |mesh: &SceneMesh| geometry.materials[mesh.material].alpha != AlphaMode::Opaque;
        Self {
            rays: RayScene::from_geometry(geometry),
            is_masked: geometry.meshes.iter().map(is_masked).collect(),
        }
    }

    /// Whether anything intersects the segment; `None` if masks might decide.
    fn is_occluded(&self, origin: Vec3, end: Vec3) -> Option<bool> {
        let meets = |masked: bool| {
            let accepts = |hit: &Hit| self.is_masked[hit.triangle.mesh] == masked;
            self.rays.any_where(origin, end - origin, 1.0, accepts)
        };
        if meets(false) { Some(true) } else { (!meets(true)).then_some(false) }
    }
}

fn measure(scene: &SceneDescription, seconds: f32, size: UVec2) -> [(&'static str, Counts); 2] {
    let pose = scene.paths["tour"].sample(seconds).expect("a time of the tour");
    // Its VPLs and trees are used alone.
    let mut stage = set::open(scene, set::options(size.x / 2, size.y / 2));
    stage.place(pose.position, pose.rotation);
    set::apply(&mut stage, "default");
    stage.get_ready().unwrap_or_else(|error| panic!("{error}"));
    let replay = Replay::new(&mut stage);

    let loaded = set::loaded(scene);
    let traced = loaded.reference().unwrap_or_else(|error| panic!("{error}"));
    let bounds = loaded.geometry.bounds().expect("a scene with triangles");
    let truth = Truth::new(&loaded.geometry);
    let image = Image {
        size,
        hits: surfaces(&traced, &scene.view(pose, size)),
        eye: pose.position,
        reach: 2.0 * bounds.size().length(),
    };
    let [to_vpls, to_sky] = drawn::rays(&stage, &image);
    [("VPLs", to_vpls), ("sky", to_sky)].map(|(kind, rays)| {
        let mut counts = Counts::default();
        for rays in rays.chunks(BATCH * WAVE) {
            let logs = replay.run(&stage, rays);
            for (rays, logs) in rays.chunks(WAVE).zip(logs.chunks(WAVE * WORDS)) {
                counts.add(rays, logs, &truth);
            }
        }
        (kind, counts)
    })
}
