//! A stage in a child process.
//!
//! Software Vulkan drivers recompile a material's shader in every frame that draws several textured
//! materials, and never free the result: megabytes per frame, which not even closing the device
//! releases. So the command line's stage is a child process, which is replaced when it has grown
//! too large. Its meter also covers the renderer alone: search, comparison and report run in the
//! parent.
//!
//! Several children render side by side what does not depend on the order (`Measure::measure_all`).
//!
//! Messages are a length (u32, little endian) and that many bytes of JSON; a reply with an image is
//! followed by its pixels.

mod client;
mod process;
mod server;

use std::io::{self, Read, Write};
use std::path::PathBuf;

use bevy_frugal_gi::power::MeterInfo;
use frugal_core::frontier::CostPoint;
use frugal_core::knobs::{KnobLevels, KnobSpace};
use frugal_core::units::Watts;
use frugal_trace::scene::CameraPose;
use serde::{Deserialize, Serialize, de::DeserializeOwned};

use crate::stage::StageOptions;

pub(crate) use client::RemoteStage;
pub(crate) use process::RemoteError;
pub(crate) use server::serve;

/// A request of the parent.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
enum Request {
    /// Opens the stage of a scene file; the first request.
    Open { scene: PathBuf, options: StageOptions },
    /// Renders every level of every knob once.
    Warm,
    /// Cost of settings over a clip: the poses of consecutive frames.
    Measure { clip: Vec<CameraPose>, settings: KnobLevels },
    /// Starts a run.
    Begin { pose: CameraPose, settings: KnobLevels },
    /// Renders one frame of a run.
    Play { pose: CameraPose, settings: KnobLevels },
}

/// A reply of the child, with its memory use.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
struct Reply {
    /// Resident bytes; 0 where unknown.
    pub resident_bytes: u64,
    /// The answer.
    pub answer: Answer,
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
enum Answer {
    Opened(Opened),
    Done,
    Cost(CostPoint),
    /// Followed by width × height × 3 bytes.
    Frame {
        power: Watts,
        width: u32,
        height: u32,
    },
    Failed {
        usage: bool,
        message: String,
    },
}

/// What a child says of its stage.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
struct Opened {
    pub space: KnobSpace,
    pub meter: MeterInfo,
    pub idle: Watts,
}

/// Longest message, bytes: a longer length is not from a stage.
const LONGEST: u32 = 1 << 20;

fn send(to: &mut impl Write, message: &impl Serialize) -> io::Result<()> {
    let bytes = serde_json::to_vec(message)?;
    to.write_all(&(bytes.len() as u32).to_le_bytes())?;
    to.write_all(&bytes)
}

fn receive<T: DeserializeOwned>(from: &mut impl Read) -> io::Result<T> {
    let mut length = [0; 4];
    from.read_exact(&mut length)?;
    let length = u32::from_le_bytes(length);
    if length > LONGEST {
        return Err(io::Error::new(io::ErrorKind::InvalidData, "not a stage's message"));
    }
    let mut bytes = vec![0; length as usize];
    from.read_exact(&mut bytes)?;
    Ok(serde_json::from_slice(&bytes)?)
}

#[cfg(test)]
mod tests {
    use glam::{Quat, Vec3};

    use super::*;

    #[test]
    fn messages_round_trip_and_invalid_ones_are_refused() {
        let position = Vec3::new(0.1, -2.0, 1e6);
        let clip = vec![CameraPose { position, rotation: Quat::IDENTITY }; 2];
        let request = Request::Measure { clip, settings: KnobLevels::from_bits(u128::MAX) };
        let mut pipe = Vec::new();
        send(&mut pipe, &request).expect("a vector takes it");
        assert_eq!(receive::<Request>(&mut pipe.as_slice()).expect("what was sent"), request);
        assert!(receive::<Request>(&mut &pipe[..pipe.len() - 1]).is_err());
        assert!(receive::<Request>(&mut [0xff; 8].as_slice()).is_err());
    }
}
