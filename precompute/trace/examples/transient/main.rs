//! Light in time: rates of convergence, fog sampled uniformly in time, a mirror's light from photons,
//! and a time-of-flight camera.
//!
//! `cargo run -p frugal_trace --features caustics,time --example transient -- [FOLDER [SEEDS]]`;
//! pictures go into the folder. Every figure is the median over the seeds, with the least and the
//! greatest.

mod camera;
mod mirror;
mod rates;
#[path = "../common/sheet.rs"]
mod sheet;
#[path = "../common/timing.rs"]
mod timing;

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let folder = std::path::PathBuf::from(arguments.first().map_or(".", String::as_str));
    let seeds: u64 = arguments.get(1).map_or(5, |text| text.parse().expect("a whole number"));
    let table = |name: &str, of: &dyn Fn(u64) -> Vec<(&'static str, f64)>| {
        let runs: Vec<_> = (0..seeds.max(1)).map(of).collect();
        println!("{name}");
        for row in 0..runs[0].len() {
            let mut values: Vec<f64> = runs.iter().map(|run| run[row].1).collect();
            values.sort_by(f64::total_cmp);
            let (least, most) = (values[0], values[values.len() - 1]);
            let median = values[values.len() / 2];
            println!("  {:44} {median:9.3}  [{least:.3}, {most:.3}]", runs[0][row].0);
        }
    };
    table("Slope of the squared error over paths, light of one pixel", &rates::slopes);
    table("Single scattering in fog, relative squared error per frame", &rates::fog);
    table("Light that a mirror throws, error ÷ mean", &mirror::errors);
    table("Time of flight: absolute error of depth, cm", &camera::errors);
    camera::pictures(&folder);
}
