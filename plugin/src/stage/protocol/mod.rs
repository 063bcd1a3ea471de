//! The messages between the tool `frugal` and an app on its stage. Internal: they change with every
//! version.
//!
//! The app connects, and says [`Hello`]. Then each request has one reply. A message is a length (u32,
//! little endian) and that many bytes of JSON. Large data, such as pixels or a scene, follows its
//! reply as raw bytes.

mod server;

use std::io::{self, Read, Write};
use std::net::TcpStream;

use frugal_trace::scene::CameraPose;
use serde::{Deserialize, Serialize, de::DeserializeOwned};

use super::evaluator::Measurement;
use super::options::{StageError, StageOptions};
use crate::knobs::{KnobLevels, KnobSpace};
use crate::power::MeterInfo;
use crate::units::Watts;
pub(super) use server::{Requests, serve};

/// Environment variable with the tool's address: `127.0.0.1:PORT/TOKEN`. The app says the token first: other
/// users of the machine cannot read a process' environment.
pub const STAGE_VARIABLE: &str = "FRUGAL_STAGE";
/// Environment variable with the level to load.
pub const LEVEL_VARIABLE: &str = "FRUGAL_STAGE_LEVEL";
/// Number of the protocol. Raise it with every change of a message.
pub const PROTOCOL: u32 = 3;

/// The app's first message. Its form never changes, so that any two versions understand it.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Hello {
    /// [`PROTOCOL`].
    pub protocol: u32,
    /// The plugin's version.
    pub version: String,
    /// The app's name: that of its program.
    pub app: String,
}

impl Hello {
    /// The one of this program.
    pub fn here() -> Self {
        let program = std::env::current_exe().unwrap_or_default();
        let app = program.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        Self { protocol: PROTOCOL, version: env!("CARGO_PKG_VERSION").to_owned(), app }
    }
}

/// A request of the tool.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum Request {
    /// Waits for the level.
    Load {
        /// Longest wait, seconds.
        seconds: f64,
        /// Whether its scene is asked for.
        scene: bool,
    },
    /// Makes a stage of the app; after `Load`, once.
    Open(StageOptions),
    /// Renders every level of every knob once.
    Warm,
    /// Cost of settings over a clip: the poses of consecutive frames.
    Measure {
        /// The poses.
        clip: Vec<CameraPose>,
        /// The settings.
        settings: KnobLevels,
    },
    /// Starts a run.
    Begin {
        /// The pose of its first frame.
        pose: CameraPose,
        /// Its settings.
        settings: KnobLevels,
    },
    /// Renders one frame of a run.
    Play {
        /// Its pose.
        pose: CameraPose,
        /// Its settings.
        settings: KnobLevels,
    },
    /// Renders one image.
    Shoot {
        /// Its pose.
        pose: CameraPose,
        /// The settings in words.
        settings: String,
    },
}

/// A reply of the app.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Reply {
    /// Resident bytes; 0 where unknown.
    pub resident_bytes: u64,
    /// Number of raw bytes that follow.
    pub bytes: u64,
    /// The answer.
    pub answer: Answer,
}

/// An answer to a request.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum Answer {
    /// To `Load`: an [`ExtractedScene`](super::extract::ExtractedScene) of so many bytes follows, by
    /// `postcard`.
    Loaded {
        /// Every knob of the app, opt-in ones included.
        knobs: KnobSpace,
        /// Names of the opt-in ones.
        opt_in: Vec<String>,
    },
    /// To `Open`.
    Opened(Opened),
    /// To `Warm` and `Begin`.
    Done,
    /// To `Measure`.
    Measured(Measurement),
    /// To `Play` and `Shoot`: width × height × 3 bytes follow.
    Frame {
        /// Power, with a meter.
        power: Option<Watts>,
        /// Pixels in a row.
        width: u32,
        /// Rows.
        height: u32,
    },
    /// To `Shoot` on a stage of radiance: width × height × 3 floats follow, little endian.
    Radiance {
        /// Pixels in a row.
        width: u32,
        /// Rows.
        height: u32,
    },
    /// To all requests.
    Failed(StageError),
}

/// What an app says of its stage.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Opened {
    /// The knobs on offer.
    pub space: KnobSpace,
    /// The meter, if there is one.
    pub meter: Option<MeterInfo>,
    /// Idle power, as far as the meter covers it.
    pub idle: Watts,
}

/// Longest message, bytes: a longer length is not from a stage.
const LONGEST: u32 = 1 << 20;

/// Connects to the tool at `address`, the value of [`STAGE_VARIABLE`].
///
/// # Errors
/// When nobody listens there.
pub(super) fn connect(address: &str) -> io::Result<TcpStream> {
    let (port, token) = address.split_once('/').ok_or(io::ErrorKind::InvalidInput)?;
    let mut socket = TcpStream::connect(port)?;
    socket.set_nodelay(true)?;
    socket.write_all(token.as_bytes())?;
    Ok(socket)
}

/// Sends a message.
///
/// # Errors
/// When the connection is gone.
pub fn send(to: &mut impl Write, message: &impl Serialize) -> io::Result<()> {
    let bytes = serde_json::to_vec(message)?;
    to.write_all(&(bytes.len() as u32).to_le_bytes())?;
    to.write_all(&bytes)
}

/// Waits for a message.
///
/// # Errors
/// When the connection is gone, or this is no such message.
pub fn receive<T: DeserializeOwned>(from: &mut impl Read) -> io::Result<T> {
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
    use bevy::math::{Quat, Vec3};

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

    #[test]
    fn any_version_understands_the_first_message() {
        let text = r#"{"protocol":1,"version":"0.1.0","app":"a","more":true}"#;
        let hello: Hello = serde_json::from_str(text).expect("a greeting");
        assert_eq!((hello.protocol, hello.version.as_str(), hello.app.as_str()), (1, "0.1.0", "a"));
        assert_eq!(Hello::here().protocol, PROTOCOL);
    }
}
