//! Tests of the format.

use proptest::prelude::*;

use super::*;

const HEADER: &str =
    "frugal-cameras 1\ntime_s,camera,x_m,y_m,z_m,qx,qy,qz,qw,vertical_fov_rad,aspect\n";

fn sample() -> CameraSample {
    let rotation = Quat::from_rotation_y(0.3);
    let position = Vec3::new(0.0, 1.7, -6.0);
    CameraSample { time_s: 0.25, camera: 3, position, rotation, vertical_fov: 1.0, aspect: 1.5 }
}

/// A recording of one sample, with `value` in the field `column`.
fn file_with(column: &str, value: &str) -> String {
    let mut fields = ["0.25", "0", "1.0", "2.0", "3.0", "0.0", "0.0", "0.0", "1.0", "1.0", "1.5"];
    fields[COLUMNS.iter().position(|name| *name == column).expect("a column")] = value;
    format!("{HEADER}{}\n", fields.join(","))
}

#[test]
fn the_format_is_the_documented_one() {
    let still = CameraSample { rotation: Quat::IDENTITY, ..sample() };
    let text = to_text(&[still]);
    assert_eq!(text, format!("{HEADER}0.25,3,0.0,1.7,-6.0,0.0,0.0,0.0,1.0,1.0,1.5\n"));
    assert_eq!(parse(&text), Ok(vec![still]));
    assert_eq!(parse(HEADER), Ok(Vec::new()));
}

#[test]
fn a_truncated_last_line_loses_that_line_alone() {
    let one = to_text(&[sample()]);
    let two = to_text(&[sample(), CameraSample { time_s: 0.5, ..sample() }]);
    for end in one.len()..two.len() {
        assert_eq!(parse(&two[..end]), Ok(vec![sample()]), "cut at {end}");
    }
    assert_eq!(parse(&two).map(|samples| samples.len()), Ok(2));
    // The second line of the header is truncated.
    assert_eq!(parse(&HEADER[..30]), Ok(Vec::new()));
}

#[test]
fn editor_line_ends_and_spaces_are_accepted() {
    let text =
        format!("\u{feff}{}\n", to_text(&[sample()])).replace('\n', "\r\n").replace(',', ", ");
    assert_eq!(parse(&text), Ok(vec![sample()]));
}

#[test]
fn other_files_are_rejected() {
    let header = |found: &str| Err(CameraFileError::Header { found: found.to_owned() });
    assert_eq!(parse(""), header(""));
    assert_eq!(parse("\n"), header(""));
    assert_eq!(parse("frugal-cameras"), header("frugal-cameras"));
    assert_eq!(parse("frugal-cameras 1"), Ok(Vec::new()), "the line is truncated");
    assert_eq!(parse("frugal-cameras one\n"), header("frugal-cameras one"));
    assert_eq!(parse(&"ä".repeat(1000)), header(&"ä".repeat(40)));
    assert_eq!(parse("frugal-cameras 2\nanything"), Err(CameraFileError::Version { found: 2 }));
    let columns = parse("frugal-cameras 1\ntime_s,camera\n");
    assert_eq!(columns, Err(CameraFileError::Columns { found: "time_s,camera".to_owned() }));
}

#[test]
fn errors_name_line_field_and_remedy() {
    let message = |text: &str| parse(text).expect_err(text).to_string();
    let remedy = ": correct the line, or remove it";
    let few = format!("{}1.0,2\n", to_text(&[sample()]));
    assert_eq!(message(&few), format!("line 4: 2 fields instead of 11{remedy}"));
    assert_eq!(
        message(&file_with("qy", "north")),
        format!("line 3: `qy` is `north`, which is not a number{remedy}")
    );
    let whole = "which is not a whole number from 0 to 4294967295";
    assert_eq!(
        message(&file_with("camera", "-1")),
        format!("line 3: `camera` is `-1`, {whole}{remedy}")
    );
    assert_eq!(
        message(&file_with("camera", "")),
        format!("line 3: `camera` is ``, {whole}{remedy}")
    );
    let aspect = format!("line 3: `aspect` is 0, which must be finite and above 0{remedy}");
    assert_eq!(message(&file_with("aspect", "0")), aspect);
}

#[test]
fn numbers_out_of_range_are_rejected_in_every_column() {
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
            match parse(&file_with(column, value)) {
                Err(CameraFileError::OutOfRange { line: 3, number }) => {
                    assert_eq!(number.field, column, "{value}");
                }
                other => panic!("{column} = {value}: {other:?}"),
            }
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
        assert_eq!(samples[0].rotation, Quat::IDENTITY, "{value}");
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
        let sample = CameraSample { time_s, camera, position, rotation, vertical_fov, aspect };
        let valid = sample.validated();
        prop_assume!(valid.is_ok());
        let valid = valid.unwrap();
        let read = parse(&to_text(&[valid])).unwrap();
        prop_assert_eq!(read.len(), 1);
        prop_assert_eq!(read[0], valid);
        // Equal numbers may differ in the sign of zero.
        prop_assert_eq!(read[0].position.to_array().map(f32::to_bits), valid.position.to_array().map(f32::to_bits));
        prop_assert_eq!(read[0].rotation.to_array().map(f32::to_bits), valid.rotation.to_array().map(f32::to_bits));
    }

    #[test]
    fn no_text_panics_the_parser(text: String, line in "[-0-9.e,naif]{0,60}") {
        let _ = parse(&text);
        let _ = parse(&format!("{HEADER}{line}\n{text}"));
    }
}
