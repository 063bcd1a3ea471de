//! A display-referred image, 8 bits per channel.

use std::io::Cursor;
use std::path::{Path, PathBuf};

use image::codecs::png::PngEncoder;
use image::{ExtendedColorType, ImageEncoder, ImageError, ImageFormat, ImageReader};

/// 8-bit sRGB, row by row from the top.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Picture {
    /// Pixels in a row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// `width` × `height` × (red, green, blue).
    pub rgb: Vec<[u8; 3]>,
}

/// Why an image could not be made, read or written.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum PictureError {
    /// The pixels do not fill the rectangle exactly.
    #[error("an image of {width}×{height} has {expected} pixels, not {given}")]
    PixelCount {
        /// Pixels in a row.
        width: u32,
        /// Rows.
        height: u32,
        /// `width` × `height`.
        expected: u64,
        /// Number of pixels given.
        given: usize,
    },
    /// A file could not be read or written.
    #[error("{path}: {source}", path = path.display())]
    File {
        /// The file.
        path: PathBuf,
        /// The system's error.
        source: std::io::Error,
    },
    /// Bytes that are not a PNG, or pixels that the encoder refused.
    #[error("{name}: {source}")]
    Png {
        /// The file, or `image` for one in memory.
        name: String,
        /// The codec's error.
        source: ImageError,
    },
}

impl Picture {
    /// An image of `rgb`, row by row from the top.
    ///
    /// # Errors
    /// When `rgb` does not hold exactly `width` × `height` pixels.
    pub fn new(width: u32, height: u32, rgb: Vec<[u8; 3]>) -> Result<Self, PictureError> {
        let picture = Self { width, height, rgb };
        picture.check()?;
        Ok(picture)
    }

    fn check(&self) -> Result<(), PictureError> {
        let Self { width, height, .. } = *self;
        let (expected, given) = (u64::from(width) * u64::from(height), self.rgb.len());
        if given as u64 == expected {
            return Ok(());
        }
        Err(PictureError::PixelCount { width, height, expected, given })
    }

    /// The image whose pixel in column `x` of row `y` is `pixel(x, y)`.
    pub fn from_fn(width: u32, height: u32, mut pixel: impl FnMut(u32, u32) -> [u8; 3]) -> Self {
        let rgb = (0..height)
            .flat_map(|y| (0..width).map(move |x| (x, y)))
            .map(|(x, y)| pixel(x, y))
            .collect();
        Self { width, height, rgb }
    }

    /// Reads a PNG file. 16-bit channels are rounded to 8, an alpha channel is dropped.
    ///
    /// # Errors
    /// When the file cannot be read or is not a PNG.
    pub fn read_png(path: &Path) -> Result<Self, PictureError> {
        let bytes = std::fs::read(path)
            .map_err(|source| PictureError::File { path: path.to_owned(), source })?;
        let decoded = ImageReader::with_format(Cursor::new(bytes), ImageFormat::Png)
            .decode()
            .map_err(|source| PictureError::Png { name: path.display().to_string(), source })?
            .into_rgb8();
        let (width, height) = decoded.dimensions();
        Self::new(width, height, decoded.as_raw().as_chunks().0.to_vec())
    }

    /// The bytes of an 8-bit RGB PNG file.
    ///
    /// # Errors
    /// When the image is empty, which the format does not allow, or its fields are inconsistent.
    pub fn to_png(&self) -> Result<Vec<u8>, PictureError> {
        self.check()?;
        let mut bytes = Vec::new();
        PngEncoder::new(&mut bytes)
            .write_image(self.rgb.as_flattened(), self.width, self.height, ExtendedColorType::Rgb8)
            .map_err(|source| PictureError::Png { name: "image".to_owned(), source })?;
        Ok(bytes)
    }

    /// Writes a PNG file, replacing an existing file.
    ///
    /// # Errors
    /// As [`to_png`](Self::to_png), and when the file cannot be written.
    pub fn write_png(&self, path: &Path) -> Result<(), PictureError> {
        std::fs::write(path, self.to_png()?)
            .map_err(|source| PictureError::File { path: path.to_owned(), source })
    }

    /// Luma of every pixel, 0 to 255: Rec. 709's weights on the 8-bit, non-linear values.
    ///
    /// On the display-referred values, not on linear light: the eye's response is close to the
    /// transfer curve's, and Wang et al. defined SSIM's constants for such values. In linear light
    /// a visible difference in the shadows would weigh a hundredth of its due.
    pub fn luma(&self) -> Vec<f32> {
        self.rgb
            .iter()
            .map(|&[red, green, blue]| {
                0.2126 * f32::from(red) + 0.7152 * f32::from(green) + 0.0722 * f32::from(blue)
            })
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn picture() -> Picture {
        Picture::from_fn(7, 5, |x, y| [x as u8 * 36, y as u8 * 63, 255 - x as u8])
    }

    #[test]
    fn pixels_must_fill_the_rectangle() {
        assert!(Picture::new(2, 2, vec![[0; 3]; 4]).is_ok());
        let refused = Picture::new(2, 2, vec![[0; 3]; 3]).map_err(|error| error.to_string());
        assert_eq!(refused, Err("an image of 2×2 has 4 pixels, not 3".to_owned()));
        assert!(Picture::new(u32::MAX, u32::MAX, vec![]).is_err(), "the product does not overflow");
    }

    #[test]
    fn png_round_trips_without_loss() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("picture.png");
        picture().write_png(&file).unwrap();
        assert_eq!(Picture::read_png(&file).unwrap(), picture());
    }

    #[test]
    fn bad_files_are_named() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("missing.png");
        assert!(Picture::read_png(&file).unwrap_err().to_string().contains("missing.png"));
        std::fs::write(&file, b"not a picture").unwrap();
        assert!(Picture::read_png(&file).unwrap_err().to_string().contains("missing.png"));
        assert!(Picture::default().to_png().is_err(), "an empty picture is no PNG");
        assert!(Picture { width: 3, ..picture() }.to_png().is_err());
    }

    #[test]
    fn luma_weighs_green_most_and_spans_the_range() {
        let picture =
            Picture::new(5, 1, vec![[0; 3], [255; 3], [255, 0, 0], [0, 255, 0], [0, 0, 255]])
                .unwrap();
        let expected = [0.0, 255.0, 54.213, 182.376, 18.411];
        for (luma, expected) in picture.luma().into_iter().zip(expected) {
            assert!((luma - expected).abs() < 1e-3, "{luma} is not {expected}");
        }
    }
}
