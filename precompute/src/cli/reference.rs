//! `frugal reference`: one image, path-traced on the CPU.

use std::time::Instant;

use frugal_trace::bsdf::Shading;
use frugal_trace::integrator::{Guide, Settings, Watch, render};
use frugal_trace::metrics::tone;
use glam::UVec2;

use super::CliError;
use super::arguments::{
    COMPONENTS, CameraArguments, Choices, PictureArguments, one_of, size, write,
};
use super::input::open_scene;
use super::progress::{Progress, interrupted};
use crate::stage::Component;

#[derive(clap::Args, Debug)]
pub(super) struct Arguments {
    #[command(flatten)]
    camera: CameraArguments,
    /// Size of the image in pixels
    #[arg(long, value_name = "WxH", default_value = "320x180", value_parser = size)]
    size: UVec2,
    /// Component of the light
    #[arg(long, value_name = "COMPONENT", default_value = "full", value_parser = one_of(COMPONENTS))]
    component: Component,
    /// Indirect bounces: a number, or `all`, the default; direct light has none
    #[arg(long, value_name = "N|all", value_parser = bounces, allow_hyphen_values = true)]
    bounces: Option<Bounces>,
    /// Paths per pixel; powers of two are best
    #[arg(long, value_name = "N", default_value_t = 256, value_parser = clap::value_parser!(u32).range(1..=1 << 24), allow_hyphen_values = true)]
    spp: u32,
    /// Seed of every random choice
    #[arg(long, value_name = "N", default_value_t = 0)]
    seed: u64,
    /// Makes every surface Lambertian, as for virtual point lights: base colour × (1 − metallic),
    /// no specular lobe
    #[arg(long)]
    lambertian: bool,
    /// Where paths go on: anywhere their surface scatters, or also where photons came from: far less
    /// noise in rooms lit by small lit spots, up to a sixth slower elsewhere
    #[arg(long, value_name = "GUIDE", default_value = "none", value_parser = one_of(GUIDES))]
    guide: Guide,
    #[command(flatten)]
    picture: PictureArguments,
}

/// What tells paths where light comes from.
const GUIDES: Choices<Guide> = &[
    ("none", Guide::None, "Nothing"),
    ("photons", Guide::Photons, "Photons, traced before the image, where they pay"),
];

/// Greatest number of bounces; `None` for no limit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Bounces(Option<u32>);

fn bounces(text: &str) -> Result<Bounces, String> {
    match text.trim() {
        "all" => Ok(Bounces(None)),
        number => number
            .parse()
            .map(|count| Bounces(Some(count)))
            .map_err(|_| "expected a whole number, 0 or above, or `all`".to_owned()),
    }
}

pub(super) fn run(arguments: &Arguments) -> Result<(), CliError> {
    let is_direct = arguments.component == Component::Direct;
    if is_direct && arguments.bounces.is_some_and(|bounces| bounces.0 != Some(0)) {
        return Err(CliError::usage("--bounces: direct light has none; give another --component"));
    }
    // Before an app is built.
    let pose = arguments.camera.pose()?;
    arguments.picture.check()?;
    let description = open_scene(&arguments.camera.scene)?;
    let png = arguments.picture.png(&description.name)?;
    let scene = description.reference().map_err(CliError::usage)?;
    let view = description.view(pose, arguments.size);
    let settings = Settings {
        samples: arguments.spp,
        // Components that are not requested are not traced.
        bounces: if is_direct { Some(0) } else { arguments.bounces.and_then(|bounces| bounces.0) },
        seed: arguments.seed,
        shading: if arguments.lambertian { Shading::Lambertian } else { Shading::Standard },
        guide: arguments.guide,
        ..Default::default()
    };

    let started = Instant::now();
    let shown = Progress::new(u64::from(arguments.size.y), "rows");
    let rendering = render(
        &scene,
        &view,
        &settings,
        Watch { row_done: &|| shown.step(), interrupted: &interrupted },
    );
    drop(shown);
    let rendering =
        rendering.ok_or_else(|| CliError::failed("interrupted: nothing was written"))?;
    let radiance = match arguments.component {
        Component::Full => rendering.full(),
        Component::Direct => rendering.direct,
        Component::Indirect => rendering.indirect,
        Component::Global => rendering.global(),
    };
    println!("mean radiance {:.3} nits", radiance.mean());
    println!(
        "{} triangles, {} paths a pixel, {:.1} s; {} paths dropped as not finite",
        scene.triangle_count(),
        arguments.spp,
        started.elapsed().as_secs_f64(),
        rendering.dropped
    );
    if let Some(path) = png {
        let picture = tone::display(&radiance, description.exposure_ev100);
        write(&path, &picture.to_png().map_err(CliError::failed)?)?;
    }
    if let Some(path) = &arguments.picture.hdr {
        write(path, &radiance.to_exr().map_err(CliError::failed)?)?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bounces_are_a_number_or_all() {
        assert_eq!(
            [bounces("all"), bounces("0"), bounces(" 3 ")],
            [Ok(Bounces(None)), Ok(Bounces(Some(0))), Ok(Bounces(Some(3)))]
        );
        assert!(
            ["", "-1", "1.5", "none", "99999999999"].into_iter().all(|text| bounces(text).is_err())
        );
    }
}
