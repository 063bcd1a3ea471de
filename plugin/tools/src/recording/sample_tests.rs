//! Tests of the format.

use proptest::prelude::*;

use super::*;
use crate::row_log::{RowLogError, read_rows, rows_to_text};

const HEADER: &str =
    "frugal-cameras 1\ntime_s,camera,x_m,y_m,z_m,qx,qy,qz,qw,vertical_fov_rad,aspect\n";

fn sample() -> CameraSample {
    let (position, rotation) = (Vec3::new(0.0, 1.7, -6.0), Quat::from_rotation_y(0.3));
    CameraSample::new(0.25, 3, &CameraView { position, rotation, vertical_fov: 1.0, aspect: 1.5 })
}

fn parse(text: &str) -> Result<Vec<CameraSample>, RowLogError> {
    read_rows(text)
}

/// A recording of one sample, with `value` in the field `column`.
fn file_with(column: &str, value: &str) -> String {
    let mut fields = ["0.25", "0", "1.0", "2.0", "3.0", "0.0", "0.0", "0.0", "1.0", "1.0", "1.5"];
    let columns = HEADER.lines().nth(1).expect("columns");
    fields[columns.split(',').position(|name| name == column).expect("a column")] = value;
    format!("{HEADER}{}\n", fields.join(","))
}

#[test]
fn the_format_is_the_documented_one() {
    let still = CameraSample { qx: 0.0, qy: 0.0, qz: 0.0, qw: 1.0, ..sample() };
    let text = rows_to_text(&[still]);
    assert_eq!(text, format!("{HEADER}0.25,3,0.0,1.7,-6.0,0.0,0.0,0.0,1.0,1.0,1.5\n"));
    assert_eq!(parse(&text), Ok(vec![still]));
    assert_eq!(parse(HEADER), Ok(Vec::new()));
    let next = "frugal-cameras 2\nanything";
    let message = parse(next).expect_err("another version").to_string();
    assert!(message.contains("`frugal-cameras 2`") && message.contains("CameraRecorderPlugin"));
}

#[test]
fn editor_line_ends_and_spaces_are_accepted() {
    let text =
        format!("\u{feff}{}\n", rows_to_text(&[sample()])).replace('\n', "\r\n").replace(',', ", ");
    assert_eq!(parse(&text), Ok(vec![sample()]));
}

#[test]
fn numbers_out_of_range_are_rejected_in_every_column() {
    let message = |text: &str| parse(text).expect_err(text).to_string();
    let expected =
        "`aspect` is 0, which must be finite and above 0: correct the line, or remove it";
    assert_eq!(message(&file_with("aspect", "0")), format!("line 3: {expected}"));
    let invalid = [
        ("time_s", vec!["NaN", "inf", "-0.25", "1e400"]),
        ("x_m", vec!["NaN", "inf", "-1.1e7"]),
        ("y_m", vec!["NaN", "-inf", "1.1e7"]),
        ("z_m", vec!["NaN", "1e39", "1e30"]),
        ("qx", vec!["NaN", "inf"]),
        ("qy", vec!["NaN", "inf"]),
        ("qz", vec!["NaN", "inf"]),
        ("qw", vec!["NaN", "inf"]),
        ("vertical_fov_rad", vec!["NaN", "0", "-1", "3.1415927", "inf"]),
        ("aspect", vec!["NaN", "0", "-1.5", "inf", "1e-60"]),
    ];
    for (column, values) in invalid {
        for value in values {
            let message = message(&file_with(column, value));
            assert!(message.starts_with("line 3: `"), "{message}");
            assert!(message.contains(column) && message.contains("must be"), "{message}");
        }
    }
    for (column, value) in
        [("x_m", "-1e7"), ("vertical_fov_rad", "1e-30"), ("aspect", "1e30"), ("time_s", "1e300")]
    {
        assert!(parse(&file_with(column, value)).is_ok(), "{column} = {value}");
    }
}

#[test]
fn rotations_are_normalised_or_rejected() {
    for value in ["0", "-0.0", "1e-7"] {
        let error = parse(&file_with("qw", value)).expect_err(value);
        assert!(error.to_string().contains("`qx,qy,qz,qw`"), "{error}");
    }
    for value in ["1e-5", "0.5", "2", "3e38"] {
        let samples = parse(&file_with("qw", value)).expect(value);
        assert_eq!(samples[0].view().rotation, Quat::IDENTITY, "{value}");
    }
}

proptest! {
    #[test]
    fn every_bit_is_restored(
        time_s in prop::num::f64::POSITIVE,
        camera: u32,
        position in prop::array::uniform3((-1.0_f32..1.0, -44..8)),
        rotation in prop::array::uniform4(-1.0_f32..1.0),
        vertical_fov in 1e-6_f32..3.1,
        aspect in prop::num::f32::POSITIVE,
    ) {
        // Positions of every magnitude.
        let position = Vec3::from_array(position.map(|(digits, power)| digits * 10_f32.powi(power)));
        let rotation = Quat::from_array(rotation);
        let view = CameraView { position, rotation, vertical_fov, aspect };
        let valid = CameraSample::new(time_s, camera, &view).validated();
        prop_assume!(valid.is_ok());
        let valid = valid.unwrap();
        let read = parse(&rows_to_text(&[valid])).unwrap();
        prop_assert_eq!(read.len(), 1);
        prop_assert_eq!(read[0], valid);
        // Equal numbers may differ in the sign of zero.
        let bits = |sample: &CameraSample| {
            let CameraView { position, rotation, .. } = sample.view();
            (position.to_array().map(f32::to_bits), rotation.to_array().map(f32::to_bits))
        };
        prop_assert_eq!(bits(&read[0]), bits(&valid));
    }
}
