//! scratch
mod corpus;
use frugal_trace::coded::*;
use frugal_trace::metrics::Radiance;

fn coded_image(case: &mut corpus::Case, codes: usize, which: usize) -> (Radiance, f64) {
    let te = 1.0 / case.random.scale(500.0, 4000.0);
    let ts = 1.0 / 30_000.0;
    let shutter = Shutter::new(te, ts, corpus::SIZE.y).unwrap();
    let start = case.random.between(0.0, 1.0);
    let dwell = f64::from(corpus::SIZE.y) * ts / 3.0;
    let ones = vec![1.0; corpus::SIZE.y as usize];
    let profiles: Vec<Vec<f64>> = (0..3)
        .map(|channel| {
            let code = if codes == 1 { CODES[which] } else { CODES[channel] };
            shutter.profile(&barcode(&code, dwell, 0.5, 1.0).unwrap(), start)
        })
        .collect();
    let p = [&profiles[0][..], &profiles[1][..], &profiles[2][..]];
    (compose(&[(&case.lamp, p), (&case.ambient, [&ones; 3])]).unwrap(), te)
}

fn main() {
    let t0 = std::time::Instant::now();
    let cases: Vec<corpus::Case> = corpus::all(std::env::args().nth(1).map_or(0, |a| a.parse().unwrap())).collect();
    println!("corpus {:?}", t0.elapsed());
    let rgb: Vec<f64> = CODES.concat();
    let mut cases = cases;
    let coded: Vec<_> = cases.iter_mut().map(|c| {
        let clean = { let ones = vec![1.0; 1024]; compose(&[(&c.lamp, [&ones; 3]), (&c.ambient, [&ones; 3])]).unwrap() };
        let m: Vec<_> = (0..3).map(|w| coded_image(c, 1, w).0).collect();
        let r = coded_image(c, 3, 0).0;
        (c.kind, clean, m, r)
    }).collect();
    for tolerance in [0.05, 0.02] { for coherence in [0.0, 0.9, 0.97, 0.99] {
    for prominence in [0.0, 30.0, 100.0] {
        for floor in [2.0] {
            let d = Detector { prominence, floor, tolerance, coherence, ..Detector::default() };
            let d3 = Detector { colors: true, ..d };
            let mut out = String::new();
            for kind in ["noise", "pattern", "room"] {
                let of = coded.iter().filter(|c| c.0 == kind);
                let n = of.clone().count() as f64;
                for w in 0..3 {
                    let r = ratios(&CODES[w]);
                    let fa = of.clone().filter(|c| d.detect(&c.1, &r).unwrap().is_protected()).count() as f64 / n;
                    let hit = of.clone().filter(|c| d.detect(&c.2[w], &r).unwrap().is_protected()).count() as f64 / n;
                    out += &format!(" {fa:.2}/{hit:.2}");
                }
                let r = ratios(&rgb);
                let fa = of.clone().filter(|c| d3.detect(&c.1, &r).unwrap().is_protected()).count() as f64 / n;
                let hit = of.clone().filter(|c| d3.detect(&c.3, &r).unwrap().is_protected()).count() as f64 / n;
                out += &format!(" rgb {fa:.2}/{hit:.2} |");
            }
            println!("tol {tolerance} coh {coherence} prom {prominence:5} floor {floor}: {out}");
        }
    }}}
    println!("all {:?}", t0.elapsed());
}
