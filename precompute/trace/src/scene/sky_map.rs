//! A sky: a latitude-longitude environment map.

use std::path::Path;

use glam::Vec3;
use image::{DynamicImage, ImageError, ImageReader};
use serde::{Deserialize, Serialize};

/// What to do about an image of another kind.
const ANOTHER: &str = "give a Radiance .hdr or OpenEXR file in latitude-longitude form";

/// Why an image is not a valid sky.
#[derive(Debug, thiserror::Error)]
#[error("environment map {file}: {problem}; {remedy}")]
pub struct SkyError {
    /// The file.
    pub file: String,
    /// The problem.
    pub problem: String,
    /// The remedy.
    pub remedy: &'static str,
}

/// Radiance of all directions. The first row is straight up, the middle of a row is −Z, and −X is
/// left of it. Radiance is constant within a texel.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SkyMap {
    /// Texels in a row, at least 1.
    width: u32,
    /// Rows, at least 1.
    height: u32,
    /// Row by row; finite and not negative.
    texels: Vec<[f32; 3]>,
}

impl SkyMap {
    /// Reads an image. Its values are linear; the scene's intensity gives them their unit.
    ///
    /// # Errors
    /// When it cannot be read, holds integers, which are no radiance, is empty, or holds values that are
    /// negative or not finite.
    pub fn read(file: &Path) -> Result<Self, SkyError> {
        let fail = |problem: String, remedy| {
            Err(SkyError { file: file.display().to_string(), problem, remedy })
        };
        let reader = match ImageReader::open(file) {
            Ok(reader) => reader,
            Err(error) => return fail(format!("it cannot be read: {error}"), "check the path"),
        };
        let picture = match reader.decode() {
            Ok(floats @ (DynamicImage::ImageRgb32F(_) | DynamicImage::ImageRgba32F(_))) => {
                floats.into_rgb32f()
            }
            Ok(_) => {
                let problem = "its values are integers for a screen, not linear radiance";
                return fail(problem.to_owned(), ANOTHER);
            }
            Err(ImageError::Limits(_)) => {
                let problem = "its texels take more than 512 MiB";
                return fail(problem.to_owned(), "make it smaller: 8192 × 4096 texels suffice");
            }
            Err(error) => return fail(error.to_string(), ANOTHER),
        };
        let texels = picture.as_raw().as_chunks().0.to_vec();
        Self::new(picture.width(), picture.height(), texels).or_else(|problem| {
            fail(problem.to_owned(), "write it anew, with finite values of at least 0")
        })
    }

    /// A sky of `width` × `height` texels, row by row.
    ///
    /// # Errors
    /// The problem, as for [`read`](Self::read).
    pub fn new(width: u32, height: u32, texels: Vec<[f32; 3]>) -> Result<Self, &'static str> {
        if width == 0 || height == 0 || texels.len() as u64 != u64::from(width) * u64::from(height)
        {
            return Err("it is empty");
        }
        if texels.iter().flatten().any(|value| !value.is_finite() || *value < 0.0) {
            return Err("it holds values that are negative or not finite");
        }
        Ok(Self { width, height, texels })
    }

    /// A sky of means of another sky's texels, which are valid because those are. Must have all
    /// rows.
    pub fn of_means(width: u32, height: u32, texels: Vec<[f32; 3]>) -> Self {
        debug_assert_eq!(texels.len() as u64, u64::from(width) * u64::from(height));
        Self { width, height, texels }
    }

    /// Texels in a row, and rows.
    pub fn size(&self) -> (u32, u32) {
        (self.width, self.height)
    }

    /// The texels, row by row.
    pub fn texels(&self) -> &[[f32; 3]] {
        &self.texels
    }

    /// Index in [`texels`](Self::texels) of the texel in `direction`, a unit vector.
    pub fn index(&self, direction: Vec3) -> usize {
        let u = 0.5 + direction.x.atan2(-direction.z) / std::f32::consts::TAU;
        let v = direction.y.clamp(-1.0, 1.0).acos() / std::f32::consts::PI;
        let x = ((u * self.width as f32) as u32).min(self.width - 1);
        let y = ((v * self.height as f32) as u32).min(self.height - 1);
        y as usize * self.width as usize + x as usize
    }

    /// Radiance in a direction, which is a unit vector.
    pub fn look_up(&self, direction: Vec3) -> [f32; 3] {
        self.texels[self.index(direction)]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn up_is_the_first_row_and_ahead_the_middle() {
        let mut texels = vec![[0.0; 3]; 128];
        texels[4 * 16 + 8] = [5.0, 0.0, 0.0];
        texels[..16].fill([0.0, 7.0, 0.0]);
        let sky = SkyMap::new(16, 8, texels).unwrap();
        assert_eq!(sky.look_up(Vec3::Y), [0.0, 7.0, 0.0]);
        assert_eq!(sky.look_up(Vec3::new(0.01, -0.01, -1.0).normalize()), [5.0, 0.0, 0.0]);
    }

    #[test]
    fn invalid_skies_are_refused() {
        assert!(
            SkyMap::new(0, 0, vec![]).is_err() && SkyMap::new(2, 2, vec![[1.0; 3]; 3]).is_err()
        );
        assert!(
            SkyMap::new(1, 1, vec![[f32::NAN, 0.0, 0.0]]).is_err()
                && SkyMap::new(1, 1, vec![[-1.0, 0.0, 0.0]]).is_err()
        );
    }

    #[test]
    fn files_that_are_no_radiance_get_the_remedy_that_fits() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        let floats = |value: f32| image::Rgb32FImage::from_pixel(4, 2, image::Rgb([value; 3]));
        floats(2.0).save(at("sky.exr")).unwrap();
        assert_eq!(SkyMap::read(&at("sky.exr")).unwrap().texels(), [[2.0; 3]; 8]);
        floats(-1.0).save(at("negative.exr")).unwrap();
        image::RgbImage::new(4, 2).save(at("sky.png")).unwrap();
        std::fs::write(at("broken.hdr"), "no").unwrap();
        let huge = "#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 16384 +X 32768\n";
        std::fs::write(at("huge.hdr"), huge).unwrap();
        for (name, words) in [
            ("missing.hdr", ["cannot be read", "check the path"]),
            ("broken.hdr", ["broken.hdr", "give a Radiance .hdr"]),
            ("sky.png", ["not linear radiance", "give a Radiance .hdr"]),
            ("huge.hdr", ["512 MiB", "make it smaller"]),
            ("negative.exr", ["negative", "write it anew"]),
        ] {
            let error = SkyMap::read(&at(name)).unwrap_err().to_string();
            for words in [name, words[0], words[1]] {
                assert!(error.contains(words), "`{words}` in: {error}");
            }
        }
    }
}
