//! Measures settings against truth.
use bevy::math::{UVec2, Vec3};
use frugal::metrics::{Difference, Radiance};
use frugal::reference::{ReferenceScene, Settings, Shading, View, Watch, render};
use frugal::scene::{self, CameraPose};
use frugal::stage::{Component, Output, Stage, StageOptions};
use std::path::{Path, PathBuf};

fn vec(text: &str) -> Vec3 {
    let v: Vec<f32> = text.split(',').map(|t| t.parse().unwrap()).collect();
    Vec3::new(v[0], v[1], v[2])
}

fn cpu() -> f64 {
    let text = std::fs::read_to_string("/proc/self/stat").unwrap();
    let rest: Vec<&str> = text[text.rfind(')').unwrap() + 2..].split(' ').collect();
    (rest[11].parse::<f64>().unwrap() + rest[12].parse::<f64>().unwrap()) / 100.0
}

fn main() {
    let a: Vec<String> = std::env::args().collect();
    let (file, position, look, size, component, bounces, spp) = (
        &a[1],
        vec(&a[2]),
        vec(&a[3]),
        vec(&format!("{},0", a[4].replace('x', ","))),
        &a[5],
        a[6].parse::<u32>().unwrap(),
        a[7].parse::<u32>().unwrap(),
    );
    let frames: u32 = a[8].parse().unwrap();
    let description = scene::load(Path::new(file)).unwrap();
    let size = UVec2::new(size.x as u32, size.y as u32);
    let pose = CameraPose::looking_at(position, look);
    let key = format!(
        "/tmp/sky-truth/{}_{}_{}_{}_{}_{}_{}.exr",
        Path::new(file).file_stem().unwrap().to_string_lossy(),
        a[2],
        a[3],
        a[4],
        component,
        bounces,
        spp
    );
    std::fs::create_dir_all("/tmp/sky-truth").unwrap();
    let truth = if Path::new(&key).exists() {
        Radiance::read_exr(&PathBuf::from(&key)).unwrap()
    } else {
        let settings = Settings {
            samples: spp,
            bounces: Some(bounces),
            shading: if component == "full" { Shading::Standard } else { Shading::Lambertian },
            ..Default::default()
        };
        let r =
            render(&ReferenceScene::new(&description).unwrap(), &View::new(&description, pose, size), &settings, Watch::default()).unwrap();
        let truth = match component.as_str() {
            "full" => r.full(),
            "indirect" => r.indirect,
            "direct" => r.direct,
            _ => r.global(),
        };
        std::fs::write(&key, truth.to_exr().unwrap()).unwrap();
        truth
    };
    println!("truth mean {:.4} nits", truth.mean());
    let kind = match component.as_str() {
        "full" => Component::Full,
        "indirect" => Component::Indirect,
        "direct" => Component::Direct,
        _ => Component::Global,
    };
    let options = StageOptions { size, output: Output::Radiance, component: kind, ..Default::default() };
    let mut stage = Stage::open(&description, options).unwrap();
    stage.place(pose.position, pose.rotation);
    let list: Vec<&str> = a[9].split(';').collect();
    let mut costs = vec![Vec::new(); list.len()];
    let mut found = Vec::new();
    for round in 0..3 {
        for (i, text) in list.iter().enumerate() {
            let settings = stage.space().parse(text).unwrap();
            stage.apply(settings);
            stage.get_ready().unwrap();
            if frames > 0 {
                let start = cpu();
                for _ in 0..frames {
                    stage.frame();
                }
                costs[i].push((cpu() - start) * 1000.0 / f64::from(frames));
            }
            if round == 0 {
                let radiance = stage.radiance().unwrap();
                if let Some(dir) = a.get(10) {
                    std::fs::write(format!("{dir}/{i}.exr"), radiance.to_exr().unwrap()).unwrap();
                    let png = frugal::metrics::tone::display(&radiance, description.exposure_ev100).to_png().unwrap();
                    std::fs::write(format!("{dir}/{i}.png"), png).unwrap();
                    let png = frugal::metrics::tone::display(&truth, description.exposure_ev100).to_png().unwrap();
                    std::fs::write(format!("{dir}/truth.png"), png).unwrap();
                }
                found.push(Difference::new(&radiance, &truth, Some(description.exposure_ev100)).unwrap());
            }
        }
        if frames == 0 {
            break;
        }
    }
    for (i, text) in list.iter().enumerate() {
        costs[i].sort_by(f64::total_cmp);
        let d = found[i];
        println!(
            "{:7.1} ms  ratio {:.3}  L1 {:.3}  boxes {:.3}  1-ssim {:.4}  {}",
            costs[i].get(1).copied().unwrap_or(0.0),
            d.mean_ratio,
            d.relative_l1,
            d.relative_l1_boxes,
            d.one_minus_ssim,
            text
        );
    }
}
