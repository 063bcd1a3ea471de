//! A search that was killed resumes from its journal, which nothing else takes or empties.

use std::fs;
use std::path::Path;
use std::time::{Duration, Instant};

use bevy_frugal_gi::frontier::FrontierMap;

use super::{assert_refused, command, run, stderr, tiny_scene};

tests!(a_killed_search_is_resumed);

const MAP: &str = "a.pareto.ron";

const SEARCH: [&str; 6] =
    ["--size", "32x32", "--levels", "0", "--knobs", "antialiasing,post_processing"];

fn precompute(more: &[&'static str]) -> Vec<&'static str> {
    [&["precompute", "a.scene.ron", "-o", MAP][..], &SEARCH, more].concat()
}

/// Number of complete lines of the journal.
fn lines(journal: &Path) -> usize {
    fs::read_to_string(journal).map_or(0, |text| text.matches('\n').count())
}

fn a_killed_search_is_resumed() {
    let folder = tiny_scene();
    let journal = folder.path().join(format!("{MAP}.journal"));
    let mut child = command(folder.path(), &precompute(&[]))
        .stderr(std::process::Stdio::null())
        .spawn()
        .expect("starts");
    let start = Instant::now();
    let mut wait_for = |count: usize| {
        while lines(&journal) < count {
            assert!(start.elapsed() < Duration::from_secs(60), "no journal after a minute");
            assert!(child.try_wait().expect("a child").is_none(), "over before it could be killed");
            std::thread::sleep(Duration::from_millis(20));
        }
    };
    wait_for(5);
    // While it runs, nobody takes its journal.
    let name = journal.file_name().and_then(|name| name.to_str()).expect("a name");
    for arguments in [&["merge", name][..], &precompute(&["--resume"])] {
        assert_refused(&run(folder.path(), arguments), &[name, "in use"]);
    }
    wait_for(20);
    // SIGKILL: the process cannot clean up.
    child.kill().expect("can be killed");
    child.wait().expect("ends");
    assert!(!folder.path().join(MAP).exists(), "no map before the end");
    let kept = lines(&journal) - 1;

    // Without being asked for, nothing is emptied; and a journal of another seed is refused.
    let bytes = fs::read(&journal).expect("a journal");
    assert_refused(
        &run(folder.path(), &precompute(&[])),
        &[name, "records", "--resume", "--overwrite"],
    );
    let seeds: [&[&str]; 2] = [&["--seed", "9"], &["--seed", "9", "--resume"]];
    for more in seeds {
        let words = ["its seed is `0`, here it is `9`", "--overwrite"];
        assert_refused(&run(folder.path(), &precompute(more)), &words);
    }
    // Nor does one of a model go on that has changed since, even where no triangle has.
    let model = folder.path().join("a.glb");
    let as_rendered = fs::read(&model).expect("a model");
    let mut changed = as_rendered.clone();
    let layout = changed.iter().rposition(|byte| *byte == b'\n').expect("a line break");
    changed[layout] = b' ';
    fs::write(&model, changed).expect("can be written");
    let words = ["its content of files is `", "--resume", "--overwrite"];
    assert_refused(&run(folder.path(), &precompute(&["--resume"])), &words);
    fs::write(&model, as_rendered).expect("can be written");
    assert!(fs::read(&journal).expect("still there") == bytes, "the journal was changed");

    let resumed = run(folder.path(), &precompute(&["--resume"]));
    let said = stderr(&resumed);
    assert!(resumed.status.success(), "{said}");
    let told = said.lines().find_map(|line| {
        line.strip_prefix("resuming after ")?.split(' ').next()?.parse::<usize>().ok()
    });
    println!("    {kept} lines kept, {told:?} evaluations replayed");
    // The kill may have cut the last line.
    assert!(
        told.is_some_and(|told| told > 0 && told <= kept && told + 2 >= kept),
        "{told:?} of {kept}: {said}"
    );
    let text = fs::read_to_string(folder.path().join(MAP)).expect("a map");
    let map = FrontierMap::from_ron(&text).expect("a valid map");
    assert_eq!(map.octree.corners.len(), 8);
    assert!(
        map.octree.frontiers.iter().all(|frontier| !frontier.is_empty())
            && !map.octree.frontiers.is_empty()
    );
    assert!(!journal.exists(), "nothing is left to resume");
}
