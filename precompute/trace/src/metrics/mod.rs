//! Images, and metrics of the difference of two images. Here are scene-referred images: radiance
//! before exposure and tone curve.

mod difference;
mod picture;
pub mod ssim;
pub mod tone;

use std::io::Cursor;
use std::path::{Path, PathBuf};

use glam::DVec4;
use image::{ImageError, ImageFormat, ImageReader};

use crate::color::color;
pub use difference::{Difference, DifferenceError};
pub use picture::{Picture, PictureError};
pub use ssim::{Reference, SsimError};

/// Linear radiance in nits.
#[derive(Clone, Debug, PartialEq)]
pub struct Radiance {
    /// Pixels in a row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Row by row from the top: red, green, blue.
    pub rgb: Vec<[f32; 3]>,
}

/// Why a file has no radiance.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum RadianceError {
    /// The file cannot be read.
    #[error("cannot read {path}: {source}; check the path", path = path.display())]
    Unreadable {
        /// The file.
        path: PathBuf,
        /// The system's error.
        source: std::io::Error,
    },
    /// The file is not an OpenEXR image of red, green and blue.
    #[error("{path} is no OpenEXR image of red, green and blue: {source}", path = path.display())]
    Malformed {
        /// The file.
        path: PathBuf,
        /// The decoder's error.
        source: ImageError,
    },
}

impl Radiance {
    /// Reads an OpenEXR file of float channels; an alpha channel is dropped.
    ///
    /// # Errors
    /// When the file cannot be read or is not such an image.
    pub fn read_exr(path: &Path) -> Result<Self, RadianceError> {
        let bytes = std::fs::read(path)
            .map_err(|source| RadianceError::Unreadable { path: path.to_owned(), source })?;
        let mut reader = ImageReader::with_format(Cursor::new(bytes), ImageFormat::OpenExr);
        // By default it refuses more than 512 MiB, which `frugal` itself writes.
        reader.no_limits();
        let picture = reader
            .decode()
            .map_err(|source| RadianceError::Malformed { path: path.to_owned(), source })?
            .into_rgb32f();
        Ok(Self {
            width: picture.width(),
            height: picture.height(),
            rgb: picture.as_raw().as_chunks().0.to_vec(),
        })
    }

    /// Mean over all pixels and the three channels.
    pub fn mean(&self) -> f64 {
        self.rgb.iter().flatten().map(|value| f64::from(*value)).sum::<f64>()
            / (3 * self.rgb.len()).max(1) as f64
    }

    /// Luminance of every pixel, nits: Rec. 709's weights.
    pub fn luminance(&self) -> impl Iterator<Item = f32> + '_ {
        self.rgb.iter().map(|[red, green, blue]| 0.2126 * red + 0.7152 * green + 0.0722 * blue)
    }

    /// Means of squares of `side` × `side` pixels; squares are smaller at the right and lower
    /// borders.
    #[must_use]
    pub fn boxes(&self, side: u32) -> Self {
        let side = side.max(1);
        let (width, height) = (self.width.div_ceil(side), self.height.div_ceil(side));
        let mut sums = vec![DVec4::ZERO; (width * height) as usize];
        for (index, pixel) in (0..).zip(&self.rgb) {
            let (column, row) = (index % self.width / side, index / self.width / side);
            sums[(row * width + column) as usize] += color(*pixel).extend(1.0);
        }
        let mean = |sum: DVec4| (sum.truncate() / sum.w).as_vec3().to_array();
        Self { width, height, rgb: sums.into_iter().map(mean).collect() }
    }

    /// Writes an OpenEXR file of three float channels.
    ///
    /// # Errors
    /// When it cannot be encoded.
    pub fn to_exr(&self) -> Result<Vec<u8>, ImageError> {
        let values: Vec<f32> = self.rgb.iter().flatten().copied().collect();
        let picture =
            image::Rgb32FImage::from_raw(self.width, self.height, values).unwrap_or_default();
        let mut bytes = Cursor::new(Vec::new());
        picture.write_to(&mut bytes, ImageFormat::OpenExr)?;
        Ok(bytes.into_inner())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ramp(width: u32, height: u32) -> Radiance {
        Radiance {
            width,
            height,
            rgb: (0..width * height).map(|i| [i as f32, 2.5e6, 0.001 * i as f32]).collect(),
        }
    }

    #[test]
    fn exr_round_trips_without_loss() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("light.exr");
        std::fs::write(&file, ramp(7, 5).to_exr().unwrap()).unwrap();
        assert_eq!(Radiance::read_exr(&file).unwrap(), ramp(7, 5));
    }

    #[test]
    fn no_size_is_too_large() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("light.exr");
        let mut bytes = ramp(1, 1).to_exr().unwrap();
        // 8192 × 8192 pixels by its header; without its end, so that none is read.
        let name = b"displayWindow\0box2i\0";
        let at = bytes.windows(name.len()).position(|part| part == name).unwrap() + name.len();
        // A length, the least corner, and the greatest.
        for greatest in [at + 12, at + 16] {
            bytes[greatest..greatest + 4].copy_from_slice(&8191_i32.to_le_bytes());
        }
        std::fs::write(&file, &bytes[..bytes.len() - 1]).unwrap();
        let error = Radiance::read_exr(&file).unwrap_err().to_string();
        assert!(!error.contains("limit"), "{error}");
    }

    #[test]
    fn bad_files_are_named() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("light.exr");
        assert!(matches!(Radiance::read_exr(&file), Err(RadianceError::Unreadable { .. })));
        std::fs::write(&file, b"not a picture").unwrap();
        let error = Radiance::read_exr(&file).unwrap_err();
        assert!(
            matches!(error, RadianceError::Malformed { .. })
                && error.to_string().contains("light.exr"),
            "{error}"
        );
    }

    #[test]
    fn boxes_are_means_and_the_border_boxes_are_smaller() {
        let boxes = ramp(6, 5).boxes(4);
        assert_eq!((boxes.width, boxes.height, boxes.rgb.len()), (2, 2, 4));
        // Columns 0 to 3 of rows 0 to 3; columns 4 and 5; row 4 alone; and the corner.
        assert_eq!(
            boxes.rgb.iter().map(|pixel| pixel[0]).collect::<Vec<_>>(),
            [10.5, 13.5, 25.5, 28.5]
        );
        assert!(boxes.rgb.iter().all(|pixel| pixel[1] == 2.5e6));
        assert_eq!(ramp(6, 5).boxes(1), ramp(6, 5));
    }
}
