//! Outputs that cannot be written, and a machine without an adapter, are reported before any work.

use super::{
    AT, NO_ADAPTER, SCENE, assert_refused, command, entries, folder, run, scene_with_map, write,
};

tests!(
    unwritable_outputs_are_named_before_the_work,
    wrong_arguments_are_named_before_an_app_is_built,
    a_missing_adapter_is_reported,
    a_closed_pipe_is_no_panic,
);

fn unwritable_outputs_are_named_before_the_work() {
    let folder = folder();
    scene_with_map(folder.path());
    write(folder.path(), "file", "precious");
    let before = entries(folder.path());
    for output in ["no/such/out", "file/out", "."] {
        for arguments in [
            [&["render", "a.scene.ron"][..], &AT, &["-o", output]].concat(),
            [&["render", "a.scene.ron"][..], &AT, &["--hdr", output]].concat(),
            [&["precompute", "a.scene.ron"][..], &["-o", output]].concat(),
            [&["merge", "a.scene.ron"][..], &["-o", output]].concat(),
            [
                &["evaluate", "a.scene.ron", "--map", "a.pareto.ron", "--power-budget", "60%"][..],
                &["--csv", output],
            ]
            .concat(),
            [
                &["evaluate", "a.scene.ron", "--map", "a.pareto.ron", "--power-budget", "60%"][..],
                &["--json", output],
            ]
            .concat(),
        ] {
            assert_refused(&run(folder.path(), &arguments), &[&format!("`{output}`")]);
        }
    }
    // Folders of reports.
    for arguments in [
        &["precompute", "a.scene.ron", "--report", "file"][..],
        &["precompute", "a.scene.ron", "--report", "file/report"],
        &["inspect", "a.pareto.ron", "--report", "file"],
        &["plot-log", "a.csv", "-o", "file"],
    ] {
        assert_refused(&run(folder.path(), arguments), &["file"]);
    }
    assert_eq!(entries(folder.path()), before, "files appeared");
}

fn wrong_arguments_are_named_before_an_app_is_built() {
    let folder = folder();
    let app = ["--app", "touch built; false"];
    let precompute = [&["precompute"][..], &app].concat();
    let evaluate = [&["evaluate"][..], &app, &["--power-budget", "60%", "--map"]].concat();
    let render = [&["render"][..], &app, &["--position", "1,2,3", "--look-at"]].concat();
    let reference = [&["reference"][..], &render[1..]].concat();
    for (arguments, more, words) in [
        (&precompute, &["-o", "no/such/out"][..], &["`no/such/out`"][..]),
        (&precompute, &["--cameras", "missing.cameras"], &["missing.cameras"]),
        (&precompute, &["--workers", "2"], &["--meter work"]),
        (&evaluate, &["missing.pareto.ron"], &["missing.pareto.ron"]),
        (&render, &["1,2,3"], &["no direction"]),
        (&render, &["0,0,0", "--hdr", "no/such/out"], &["`no/such/out`"]),
        (&reference, &["1,2,3"], &["no direction"]),
    ] {
        assert_refused(&run(folder.path(), &[&arguments[..], more].concat()), words);
    }
    assert_eq!(entries(folder.path()), [""; 0], "the app was started");
}

fn a_missing_adapter_is_reported() {
    let folder = folder();
    scene_with_map(folder.path());
    let before = entries(folder.path());
    for arguments in [
        [&["render", "a.scene.ron"][..], &AT].concat(),
        vec!["precompute", "a.scene.ron"],
        vec!["evaluate", "a.scene.ron", "--map", "a.pareto.ron", "--power-budget", "60%"],
    ] {
        let mut command = command(folder.path(), &arguments);
        command.envs(NO_ADAPTER);
        assert_refused(
            &command.output().expect("starts"),
            &["no graphics adapter", "mesa-vulkan-drivers"],
        );
    }
    assert_eq!(entries(folder.path()), before, "files appeared");
}

fn a_closed_pipe_is_no_panic() {
    let folder = folder();
    write(folder.path(), "a.scene.ron", SCENE);
    let arguments =
        [&["reference", "a.scene.ron", "--size", "16x16", "--spp", "1", "--hdr", "a.exr"][..], &AT]
            .concat();
    let mut process = command(folder.path(), &arguments).spawn().expect("starts");
    drop(process.stdout.take());
    let output = process.wait_with_output().expect("ends");
    let message = String::from_utf8_lossy(&output.stderr);
    assert!(
        output.status.success() && !message.contains("panicked"),
        "{:?}: {message}",
        output.status
    );
}
