//! Detections and false alarms of the detector of codes on 200 pictures.

#[path = "../examples/coded/corpus.rs"]
mod corpus;
#[path = "../examples/coded/hidden.rs"]
mod hidden;

use corpus::Rate;
use frugal_trace::coded::{CODES, Detector, ratios};

/// A quarter or less of the light unmodulated, exposures from 1/4000 to 1/1000 s.
#[test]
fn codes_are_found_and_seldom_where_there_are_none() {
    let (one, three) = (Detector::strict(), Detector { colors: true, ..Detector::strict() });
    let (first, all) = (ratios(&CODES[0]), ratios(&CODES.concat()));
    let [mut alarms, mut published, mut found, mut found_in_colors] = [Rate::default(); 4];
    for mut case in corpus::all(7) {
        let clean = hidden::clean(&case).expect("a picture");
        assert!(corpus::KINDS.iter().any(|(kind, _)| *kind == case.kind));
        let is_found = |detector: &Detector, image, code: &[f64]| {
            detector.detect(image, code).expect("a picture").is_protected()
        };
        alarms.add(is_found(&one, &clean, &first));
        published.add(is_found(&Detector::default(), &clean, &first));
        let exposure = 1.0 / case.random.scale(1000.0, 4000.0);
        let coded = hidden::coded(&mut case, [0; 3], exposure).expect("a picture");
        found.add(is_found(&one, &coded, &first));
        let coded = hidden::coded(&mut case, [0, 1, 2], exposure).expect("a picture");
        found_in_colors.add(is_found(&three, &coded, &all));
    }
    for (what, rate) in [
        ("alarms", alarms),
        ("alarms, published settings", published),
        ("found", found),
        ("found in three channels", found_in_colors),
    ] {
        println!("{what}: {} of {}, 95 %: {:.3?}", rate.hits, rate.of, rate.interval());
    }
    assert_eq!(alarms.of, 200);
    assert!(alarms.interval()[1] < 0.08, "{:?}", alarms.interval());
    assert!(found.interval()[0] > 0.7, "{:?}", found.interval());
    assert!(found_in_colors.interval()[0] > 0.8, "{:?}", found_in_colors.interval());
    assert!(published.interval()[0] > 0.5, "the published settings would do");
}
