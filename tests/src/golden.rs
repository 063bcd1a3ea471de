//! Golden pictures: small PNG files that pictures are held against.

use std::path::{Path, PathBuf};

use frugal::metrics::{Picture, ssim};

/// Largest error (1 − SSIM) between a picture and its reference: adapters round differently, and a
/// wrong picture is far beyond it.
pub const TOLERANCE: f64 = 0.01;

/// Bytes that a reference may take.
pub const LARGEST: u64 = 4096;

/// Setting this variable to 1 writes the references anew.
pub const BLESS: &str = "FRUGAL_BLESS";

/// Where the references are.
pub fn folder() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("golden")
}

/// Compares `picture` with `folder`/`name`.png.
///
/// # Errors
/// When there is no reference, it is too large, or the picture differs: then the picture is written
/// to a file that the message names.
pub fn compare(folder: &Path, name: &str, picture: &Picture) -> Result<f64, String> {
    let file = folder.join(format!("{name}.png"));
    if std::env::var_os(BLESS).is_some_and(|value| value == "1") {
        picture.write_png(&file).map_err(|error| error.to_string())?;
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
    let error = ssim::error(&reference, picture).map_err(|error| error.to_string());
    match error {
        Ok(error) if error <= TOLERANCE => Ok(error),
        other => {
            let actual = std::env::temp_dir().join(format!("frugal-golden-{name}-actual.png"));
            let written = picture
                .write_png(&actual)
                .map_or_else(|error| error.to_string(), |()| actual.display().to_string());
            let found = other.map_or_else(
                |error| error,
                |error| format!("error {error:.4}, more than {TOLERANCE}"),
            );
            Err(format!(
                "{name}: {found}; the picture is in {written}, its reference in {}; {BLESS}=1 replaces it",
                file.display()
            ))
        }
    }
}
