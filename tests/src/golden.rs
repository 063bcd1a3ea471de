//! Golden images: small PNG files that rendered images are compared with.

use std::path::{Path, PathBuf};

use frugal_trace::metrics::{Picture, ssim};

/// Largest error (1 − SSIM) between an image and its reference. It allows for the rounding of
/// different adapters; the error of an incorrect image is far larger.
pub const TOLERANCE: f64 = 0.01;

/// Largest size of a reference, bytes.
pub const LARGEST: u64 = 4096;

/// Environment variable: 1 overwrites the references.
pub const BLESS: &str = "FRUGAL_BLESS";

/// Folder of the references.
pub fn folder() -> PathBuf {
    crate::folder::package().join("golden")
}

/// Compares `image` with `folder`/`name`.png and returns the error (1 − SSIM).
///
/// # Errors If there is no reference, if it is larger than [`LARGEST`], or if the error exceeds
/// [`TOLERANCE`]. In the last case the image is written to a file that the message names.
pub fn compare(folder: &Path, name: &str, image: &Picture) -> Result<f64, String> {
    let file = folder.join(format!("{name}.png"));
    if std::env::var_os(BLESS).is_some_and(|value| value == "1") {
        image.write_png(&file).map_err(|error| error.to_string())?;
    }
    let size = std::fs::metadata(&file)
        .map_err(|error| format!("no reference {}: {error}; {BLESS}=1 writes it", file.display()))?
        .len();
    if size > LARGEST {
        return Err(format!(
            "{} has {size} bytes, more than {LARGEST}: render it smaller",
            file.display()
        ));
    }
    let reference = Picture::read_png(&file).map_err(|error| error.to_string())?;
    let error = ssim::error(&reference, image).map_err(|error| error.to_string());
    match error {
        Ok(error) if error <= TOLERANCE => Ok(error),
        other => {
            let actual = std::env::temp_dir().join(format!("frugal-golden-{name}-actual.png"));
            let written = image
                .write_png(&actual)
                .map_or_else(|error| error.to_string(), |()| actual.display().to_string());
            let found = other.map_or_else(
                |error| error,
                |error| format!("error {error:.4}, more than {TOLERANCE}"),
            );
            Err(format!(
                "{name}: {found}; the image is in {written}, its reference in {}; {BLESS}=1 replaces it",
                file.display()
            ))
        }
    }
}
