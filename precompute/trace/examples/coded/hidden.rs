//! Pictures with a code.

use frugal_trace::coded::{CODES, CodedError, Shutter, barcode, compose};
use frugal_trace::metrics::Radiance;

use crate::corpus::{Case, SIZE};

/// Rows per second.
const READ_OUT: f64 = 30_000.0;

/// The picture without a code.
pub(crate) fn clean(case: &Case) -> Result<Radiance, CodedError> {
    let steady = vec![1.0; SIZE.y as usize];
    compose(&[(&case.modulated, [&steady; 3]), (&case.ambient, [&steady; 3])])
}

/// The picture under a light with the code `codes[i]` in channel i, exposed for `exposure` seconds
/// from a random time on.
pub(crate) fn coded(
    case: &mut Case,
    codes: [usize; 3],
    exposure: f64,
) -> Result<Radiance, CodedError> {
    let shutter = Shutter::new(exposure, 1.0 / READ_OUT, SIZE.y)?;
    let start = case.random.number();
    let dwell = f64::from(SIZE.y) / READ_OUT / 3.0;
    let profile = |code: usize| -> Result<Vec<f64>, CodedError> {
        Ok(shutter.profile(&barcode(&CODES[code], dwell, 0.5, 1.0)?, start))
    };
    let [red, green, blue] = codes.map(profile);
    let steady = vec![1.0; SIZE.y as usize];
    compose(&[(&case.modulated, [&red?, &green?, &blue?]), (&case.ambient, [&steady; 3])])
}
