//! The app's side: answers the tool's requests until it closes the socket.

use std::io::{self, BufReader, BufWriter, Write};
use std::net::TcpStream;
use std::sync::mpsc::{self, Receiver};
use std::thread;
use std::time::Duration;

use bevy::app::App;

use super::{Answer, Hello, Opened, Reply, Request, receive, send};
use crate::knobs::KnobRegistry;
use crate::stage::extract::extract;
use crate::stage::{Output, Stage, StageError, level};

/// Time in which an app may end by itself when the tool is gone.
const GRACE: Duration = Duration::from_secs(2);

/// Requests of the tool, which a thread receives: it ends the app when the tool is gone, whatever the
/// app does at that time.
pub(in crate::stage) struct Requests {
    received: Receiver<Request>,
    output: BufWriter<TcpStream>,
}

impl Requests {
    /// Greets the tool at the other end of `socket`.
    ///
    /// # Errors
    /// When it is gone.
    pub(in crate::stage) fn new(socket: TcpStream) -> io::Result<Self> {
        let mut input = BufReader::new(socket.try_clone()?);
        let mut output = BufWriter::new(socket);
        send(&mut output, &Hello::here())?;
        output.flush()?;
        let (sender, received) = mpsc::channel();
        thread::Builder::new().name("frugal stage".to_owned()).spawn(move || {
            while let Ok(request) = receive(&mut input) {
                if sender.send(request).is_err() {
                    break;
                }
            }
            drop(sender);
            thread::sleep(GRACE);
            end();
        })?;
        Ok(Self { received, output })
    }
}

/// Ends the process at once: nothing of it is worth saving, and a driver's own clean-up may hang.
fn end() {
    #[cfg(unix)]
    let _ = rustix::process::kill_process(rustix::process::getpid(), rustix::process::Signal::KILL);
    #[cfg(not(unix))]
    std::process::abort();
}

/// The app, before and after it has become a stage.
enum Stand {
    App(Box<App>),
    Stage(Box<Stage>),
    /// It could not.
    Failed,
}

/// Answers requests until the tool is gone.
///
/// # Errors
/// When the connection breaks.
pub(in crate::stage) fn serve(app: App, requests: Requests) -> io::Result<()> {
    let Requests { received, mut output } = requests;
    let mut stand = Stand::App(Box::new(app));
    while let Ok(request) = received.recv() {
        let (answer, bytes) =
            answer(&mut stand, request).unwrap_or_else(|error| (Answer::Failed(error), Vec::new()));
        let count = bytes.len() as u64;
        send(&mut output, &Reply { resident_bytes: resident_bytes(), bytes: count, answer })?;
        output.write_all(&bytes)?;
        output.flush()?;
    }
    Ok(())
}

/// The answer, and the bytes that follow it.
fn answer(stand: &mut Stand, request: Request) -> Result<(Answer, Vec<u8>), StageError> {
    let stage = match (stand, request) {
        (Stand::App(app), Request::Load { seconds, scene }) => {
            let camera = level::load(app, seconds)?;
            let mut bytes = Vec::new();
            if scene {
                let scene = extract(app.world_mut(), Some(camera));
                bytes = postcard::to_stdvec(&scene).map_err(StageError::usage)?;
            }
            let registry = app.world().resource::<KnobRegistry>();
            let is_opt_in = |name: &str| registry.get(name).is_some_and(|knob| knob.is_opt_in());
            let opt_in = registry.names().filter(|name| is_opt_in(name)).map(str::to_owned);
            let (opt_in, knobs) = (opt_in.collect(), registry.space_with(|_| true)?);
            return Ok((Answer::Loaded { knobs, opt_in }, bytes));
        }
        (stand @ Stand::App(_), Request::Open(options)) => {
            options.check()?;
            let Stand::App(mut app) = std::mem::replace(stand, Stand::Failed) else {
                return Err(StageError::failed(StageError::ENDED));
            };
            let camera = level::hold(&mut app)?;
            let mut stage = Stage::new(*app, camera, options)?;
            let opened = Opened {
                space: stage.space().as_ref().clone(),
                meter: stage.meter(),
                idle: stage.idle()?,
            };
            *stand = Stand::Stage(Box::new(stage));
            return Ok((Answer::Opened(opened), Vec::new()));
        }
        (Stand::Stage(stage), request) => (stage, request),
        _ => return Err(StageError::not_ready("the stage is not open")),
    };
    let (stage, request) = stage;
    let done = match request {
        Request::Load { .. } | Request::Open(_) => {
            return Err(StageError::not_ready("the stage is open already"));
        }
        Request::Warm => {
            stage.warm()?;
            (Answer::Done, Vec::new())
        }
        Request::Measure { clip, settings } => {
            (Answer::Measured(stage.measure(&clip, settings)?), Vec::new())
        }
        Request::Begin { pose, settings } => {
            stage.begin_run(&pose, settings)?;
            (Answer::Done, Vec::new())
        }
        Request::Play { pose, settings } => {
            let (picture, power) = stage.render_frame(&pose, settings)?;
            let (width, height) = (picture.width, picture.height);
            (Answer::Frame { power, width, height }, picture.rgb.concat())
        }
        Request::Shoot { pose, settings } => {
            stage.place(pose.position, pose.rotation);
            stage.apply_text(&settings)?;
            stage.get_ready()?;
            match stage.options().output {
                Output::Display => {
                    let picture = stage.picture()?;
                    let (width, height) = (picture.width, picture.height);
                    (Answer::Frame { power: None, width, height }, picture.rgb.concat())
                }
                Output::Radiance => {
                    let radiance = stage.radiance()?;
                    let (width, height) = (radiance.width, radiance.height);
                    let bytes = radiance.rgb.iter().flatten().flat_map(|value| value.to_le_bytes());
                    (Answer::Radiance { width, height }, bytes.collect())
                }
            }
        }
    };
    stage.check()?;
    Ok(done)
}

/// Resident size from Linux's `/proc`; drivers of other systems are not known to leak.
fn resident_bytes() -> u64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = status.lines().find_map(|line| line.strip_prefix("VmRSS:"));
    line.and_then(|line| line.split_whitespace().next()?.parse::<u64>().ok())
        .map_or(0, |kilobytes| kilobytes * 1024)
}
