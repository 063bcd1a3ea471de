//! The child: a stage that answers requests on its standard output.

use std::io::{self, Write};

use frugal_trace::metrics::Picture;

use super::{Answer, Opened, Reply, Request, receive, send};
use crate::scene;
use crate::stage::{FrameRenderer, RenderedFrame, Stage, StageError, StageEvaluator};

/// Answers the parent's requests until it closes the pipe.
///
/// # Errors
/// When the pipe breaks.
pub(crate) fn serve() -> io::Result<()> {
    let mut input = io::stdin().lock();
    let mut output = io::BufWriter::new(io::stdout().lock());
    let mut stage = None;
    loop {
        let request = match receive(&mut input) {
            Ok(request) => request,
            // The parent has closed the pipe or ended.
            Err(error) if error.kind() == io::ErrorKind::UnexpectedEof => return Ok(()),
            Err(error) => return Err(error),
        };
        let (answer, picture) = answer(&mut stage, request).unwrap_or_else(|error| {
            let usage = error.is_usage();
            (Answer::Failed { usage, message: error.to_string() }, None)
        });
        send(&mut output, &Reply { resident_bytes: resident_bytes(), answer })?;
        if let Some(picture) = picture {
            picture.rgb.iter().try_for_each(|pixel| output.write_all(pixel))?;
        }
        output.flush()?;
    }
}

fn answer(
    stage: &mut Option<StageEvaluator>,
    request: Request,
) -> Result<(Answer, Option<Picture>), StageError> {
    if let Request::Open { scene, options } = request {
        let mut opened = Stage::open(&scene::load(&scene)?, options)?;
        let answer = Answer::Opened(Opened {
            space: opened.space().as_ref().clone(),
            meter: opened.meter(),
            idle: opened.idle()?,
        });
        *stage = Some(StageEvaluator::new(opened));
        return Ok((answer, None));
    }
    let Some(stage) = stage else {
        return Err(StageError::NotReady("no scene was opened".to_owned()));
    };
    match request {
        Request::Open { .. } => unreachable!("handled above"),
        Request::Warm => stage.stage().warm()?,
        Request::Measure { clip, settings } => {
            return Ok((Answer::Cost(stage.measure(&clip, settings)?), None));
        }
        Request::Begin { pose, settings } => stage.stage().begin_run("", &pose, settings)?,
        Request::Play { pose, settings } => {
            let RenderedFrame { picture, power } = stage.stage().render_frame(&pose, settings)?;
            let (width, height) = (picture.width, picture.height);
            return Ok((Answer::Frame { power, width, height }, Some(picture)));
        }
    }
    Ok((Answer::Done, None))
}

/// Resident size from Linux's `/proc`; drivers of other systems are not known to leak.
fn resident_bytes() -> u64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = status.lines().find_map(|line| line.strip_prefix("VmRSS:"));
    line.and_then(|line| line.split_whitespace().next()?.parse::<u64>().ok())
        .map_or(0, |kilobytes| kilobytes * 1024)
}
