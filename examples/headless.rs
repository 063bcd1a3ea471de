//! Renders a scene file to a PNG without a window: `headless [SCENE] [IMAGE]`.
//!
//! Look at the image, `target/headless.png` by default. The camera is at the start of the scene's
//! first path.

use std::error::Error;
use std::path::PathBuf;

use frugal::scene;
use frugal::stage::{self, StageOptions};
use frugal_examples::workspace_file;

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args_os().skip(1).map(PathBuf::from);
    let scene = scene::load(
        arguments.next().unwrap_or_else(|| workspace_file("assets/scenes/cornell.scene.ron")),
    )?;
    let image = arguments.next().unwrap_or_else(|| workspace_file("target").join("headless.png"));
    let start = scene
        .paths
        .values()
        .next()
        .and_then(|path| path.sample(path.start()))
        .ok_or("the scene has no camera path")?;

    let mut stage =
        stage::open(&scene, StageOptions { size: (640, 360).into(), ..Default::default() })?;
    stage.place(start.position, start.rotation);
    stage.get_ready()?;
    if let Some(folder) = image.parent() {
        std::fs::create_dir_all(folder)?;
    }
    stage.picture()?.write_png(&image)?;
    println!("wrote {}", image.display());
    Ok(())
}
