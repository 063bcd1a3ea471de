//! Scattering of indirect light: `scattered_share` of `surface.wgsl`, as `rsm/resolve.wgsl` uses
//! it, against numerical integrals over directions.

use std::f64::consts::{FRAC_1_PI, TAU};

use bevy::math::{DVec3, Vec3};
use frugal_tests::pixels::{Pixels, Plane, g_buffer_normal};

use super::maps::{Light, Resolve};
use super::stage;

tests!(
    the_scattered_share_is_the_mean_of_burley_and_ggx,
    surfaces_that_scatter_nothing_reflect_no_flux
);

/// A surface as stored in the G-buffer, in 255ths.
#[derive(Clone, Copy)]
struct Surface {
    color: [u8; 3],
    roughness: u8,
    reflectance: u8,
    metallic: u8,
}

impl Surface {
    fn texel(&self, normal: u32) -> [u32; 4] {
        let [red, green, blue] = self.color.map(u32::from);
        let properties = u32::from(self.reflectance) | u32::from(self.metallic) << 8;
        [red | green << 8 | blue << 16 | u32::from(self.roughness) << 24, 0, properties, normal]
    }

    /// Reflected flux for incident light of 1 lm at `cosine`: Burley's and GGX's lobes integrated
    /// over the hemisphere, without smooth mirrors.
    fn scattered(&self, cosine: f64) -> [f64; 3] {
        let share = |byte: u8| f64::from(byte) / 255.0;
        let (roughness, metallic) = (share(self.roughness), share(self.metallic));
        let base = self.color.map(|byte| share(byte).powf(2.2));
        let f0 = base.map(|base| {
            0.16 * share(self.reflectance).powi(2) * (1.0 - metallic) + base * metallic
        });
        let f90 = (f0.iter().sum::<f64>() * 50.0 * 0.33).clamp(0.0, 1.0);
        let alpha = roughness * roughness;
        let light = DVec3::new((1.0 - cosine * cosine).max(0.0).sqrt(), 0.0, cosine);
        let (steps, mut diffuse, mut specular, mut white) = (160, [0.0; 3], [0.0; 3], 0.0);
        for i in 0..steps * steps {
            // Cosine-weighted directions: the mean times π is the integral of value × cosine.
            let at = |index: i32| (f64::from(index) + 0.5) / f64::from(steps);
            let (u, angle) = (at(i / steps), TAU * at(i % steps));
            let (up, around) = (u.sqrt(), (1.0 - u).sqrt());
            let view = DVec3::new(around * angle.cos(), around * angle.sin(), up);
            let half = (light + view).normalize();
            let toward = light.dot(half).clamp(0.0, 1.0);
            let bend = 0.5 + 2.0 * alpha * toward * toward - 1.0;
            let burley = (1.0 + bend * (1.0 - cosine).powi(5)) * (1.0 + bend * (1.0 - up).powi(5));
            let k = alpha / ((1.0 - half.z * half.z).max(0.0) + (half.z * alpha).powi(2));
            let lift =
                |cosine: f64| (cosine * cosine * (1.0 - alpha * alpha) + alpha * alpha).sqrt();
            let facets =
                k * k * FRAC_1_PI * 0.5 / (cosine * lift(up) + up * lift(cosine)).max(1e-9);
            let part = 1.0 / f64::from(steps * steps);
            white += facets / FRAC_1_PI * part;
            for channel in 0..3 {
                let fresnel = f0[channel] + (f90 - f0[channel]) * (1.0 - toward).powi(5);
                specular[channel] += fresnel * facets / FRAC_1_PI * part;
                diffuse[channel] += base[channel] * (1.0 - metallic) * burley * part;
            }
        }
        let rough = ((roughness - 0.2) / 0.2).clamp(0.0, 1.0);
        let fade = rough * rough * (3.0 - 2.0 * rough);
        // Multiple scattering between facets: a white metal, however rough, absorbs nothing.
        [0, 1, 2].map(|channel| {
            diffuse[channel] + fade * specular[channel] * (1.0 + f0[channel] * (1.0 / white - 1.0))
        })
    }
}

fn sun() -> Light {
    Light {
        intensity: Vec3::ONE,
        texel_extent: 1.0,
        position: Vec3::ZERO,
        inverse_range_squared: 0.0,
        direction: Vec3::NEG_Y,
        cone: [0.0, 1.0],
    }
}

fn the_scattered_share_is_the_mean_of_burley_and_ggx() {
    let mut stage = stage();
    let resolve = Resolve::new(&mut stage, vec!["PARALLEL".into()]);
    // The bounds are the accuracy of the fit of an average; rough metals lose light between their
    // facets, in Karis' fit as in GGX itself.
    let mut worst = 0.0f64;
    for (label, surface) in [
        (
            "diffuse",
            Surface { color: [188, 120, 60], roughness: 255, reflectance: 128, metallic: 0 },
        ),
        (
            "half rough",
            Surface { color: [188, 120, 60], roughness: 128, reflectance: 128, metallic: 0 },
        ),
        ("black", Surface { color: [0; 3], roughness: 160, reflectance: 128, metallic: 0 }),
        (
            "without reflectance",
            Surface { color: [188; 3], roughness: 160, reflectance: 0, metallic: 0 },
        ),
        (
            "gold",
            Surface { color: [255, 214, 130], roughness: 153, reflectance: 128, metallic: 255 },
        ),
        (
            "half a metal",
            Surface { color: [220, 180, 90], roughness: 204, reflectance: 128, metallic: 128 },
        ),
    ] {
        let normals: Vec<(u32, DVec3)> = (0..64u32)
            .map(|index| {
                let angle = 1.35 * (index as f32 + 0.5) / 64.0;
                g_buffer_normal(Vec3::new(angle.sin(), angle.cos(), 0.0))
            })
            .collect();
        let texels: Vec<[u32; 4]> =
            normals.iter().map(|(packed, _)| surface.texel(*packed)).collect();
        let pixels = Pixels::with_texels(&stage, [8, 8], &texels, 0.5);
        let found = resolve.run(&stage, &pixels, &Plane::ORIGIN, &sun());
        for (texel, (_, normal)) in found.iter().zip(&normals) {
            let expected = surface.scattered(normal.y);
            for (channel, expected) in expected.into_iter().enumerate() {
                let off = f64::from(texel.flux[channel]) - expected;
                worst = worst.max(off.abs());
                assert!(
                    off.abs() < 0.03 + 0.04 * expected,
                    "{label} at cosine {:.3}: {:?}, {expected:.4}",
                    normal.y,
                    texel.flux
                );
            }
        }
    }
    println!("    off by at most {worst:.3}");
}

fn surfaces_that_scatter_nothing_reflect_no_flux() {
    let mut stage = stage();
    let resolve = Resolve::new(&mut stage, vec!["PARALLEL".into()]);
    let (up, _) = g_buffer_normal(Vec3::Y);
    // Forward-rendered surfaces write only depth to the G-buffer; the lowest flag marks unlit
    // surfaces; a black mirror reflects specularly only.
    let mirror = Surface { color: [0; 3], roughness: 30, reflectance: 255, metallic: 0 };
    let unlit = Surface { color: [0; 3], roughness: 200, reflectance: 128, metallic: 0 };
    for texel in [[0, 0, 0, 0], mirror.texel(up), unlit.texel(up | 1 << 24)] {
        let found = resolve.run(
            &stage,
            &Pixels::with_texels(&stage, [8, 8], &[texel; 64], 0.5),
            &Plane::ORIGIN,
            &sun(),
        );
        assert!(
            found.iter().all(|texel| texel.flux.iter().all(|flux| *flux < 1e-6)),
            "{texel:?}: {:?}",
            found[0]
        );
    }
}
