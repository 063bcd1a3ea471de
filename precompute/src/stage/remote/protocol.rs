//! Messages between parent and child.

use std::io::{self, Read, Write};
use std::path::PathBuf;

use frugal_core::frontier::CostPoint;
use frugal_core::knobs::{KnobLevels, KnobSpace};
use frugal_core::power::MeterInfo;
use frugal_core::units::Watts;
use glam::{Quat, Vec3};
use serde::{Deserialize, Serialize, de::DeserializeOwned};

/// Parameters of a child.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct StageRequest {
    /// The scene file.
    pub scene: PathBuf,
    /// Width and height, pixels.
    pub size: [u32; 2],
    /// Target frame rate.
    pub frames_per_second: f64,
    /// Names of the knobs on offer; `None`: all.
    pub knobs: Option<Vec<String>>,
    /// The meter's name.
    pub meter: Option<String>,
}

/// A request of the parent.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) enum Request {
    /// Opens the stage; the first request.
    Open(StageRequest),
    /// Renders every level of every knob once.
    Warm,
    /// Cost of settings over a clip: the poses of consecutive frames.
    Measure { clip: Vec<(Vec3, Quat)>, settings: KnobLevels },
    /// Starts a run.
    Begin { position: Vec3, rotation: Quat, settings: KnobLevels },
    /// Renders one frame of a run.
    Play { position: Vec3, rotation: Quat, settings: KnobLevels },
}

/// A reply of the child, with its memory use.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct Reply {
    /// Resident bytes; 0 where unknown.
    pub resident_bytes: u64,
    /// The answer.
    pub answer: Answer,
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) enum Answer {
    Opened {
        space: KnobSpace,
        meter: MeterInfo,
        idle: Watts,
    },
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

/// Longest message, bytes: a longer length is not from a stage.
const LONGEST: u32 = 1 << 20;

pub(super) fn send(to: &mut impl Write, message: &impl Serialize) -> io::Result<()> {
    let bytes = serde_json::to_vec(message)?;
    to.write_all(&(bytes.len() as u32).to_le_bytes())?;
    to.write_all(&bytes)
}

pub(super) fn receive<T: DeserializeOwned>(from: &mut impl Read) -> io::Result<T> {
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
    use super::*;

    #[test]
    fn messages_round_trip_and_invalid_ones_are_refused() {
        let clip = vec![(Vec3::new(0.1, -2.0, 1e6), Quat::IDENTITY); 2];
        let request = Request::Measure { clip, settings: KnobLevels::from_bits(u128::MAX) };
        let mut pipe = Vec::new();
        send(&mut pipe, &request).expect("a vector takes it");
        assert_eq!(receive::<Request>(&mut pipe.as_slice()).expect("what was sent"), request);
        assert!(receive::<Request>(&mut &pipe[..pipe.len() - 1]).is_err());
        assert!(receive::<Request>(&mut [0xff; 8].as_slice()).is_err());
    }
}
