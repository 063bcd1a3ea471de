//! A started program, and its connection to a port of this machine.

use std::io::{self, BufReader, Read, Write};
use std::net::{Ipv4Addr, TcpListener, TcpStream};
use std::time::{Duration, Instant};

use bevy_frugal_gi::stage::protocol::{Answer, Hello, PROTOCOL, Reply, Request, receive, send};
use bevy_frugal_gi::stage::{StageError, adapter};
use frugal_core::knobs::KnobSpace;

use super::program::{Program, Running};

/// Time that a program has beyond its own limit, to say why it did not keep it.
const GRACE: Duration = Duration::from_secs(10);
/// After that it says what it waits for.
const SILENCE: Duration = Duration::from_secs(30);
/// Pause between looks for a connection.
const PAUSE: Duration = Duration::from_millis(10);

/// Why a program gave no answer.
pub(super) enum NoAnswer {
    /// It cannot do that, and goes on.
    Failed(StageError),
    /// It has ended.
    Broken(StageError),
    /// It says nothing.
    Hung(StageError),
}

impl From<NoAnswer> for StageError {
    fn from(reason: NoAnswer) -> Self {
        match reason {
            NoAnswer::Failed(error) | NoAnswer::Broken(error) | NoAnswer::Hung(error) => error,
        }
    }
}

/// A program at the other end of a socket. It ends when this does.
pub(super) struct Connection {
    program: Program,
    running: Running,
    input: BufReader<TcpStream>,
    output: TcpStream,
    /// What it said of itself.
    pub hello: Hello,
    /// Its size after the last reply, bytes.
    pub resident_bytes: u64,
    /// Its size once it was opened, bytes.
    pub bytes_when_new: u64,
}

impl Connection {
    /// Starts `program`, waits until it connects, and checks its version.
    ///
    /// # Errors
    /// When it cannot be started, does not connect, or is of another version.
    pub(super) fn open(program: &Program, threads: Option<usize>) -> Result<Self, StageError> {
        // Bevy panics without one.
        adapter().ok_or_else(|| StageError::usage(StageError::NO_ADAPTER))?;
        let name = program.name();
        let cannot = |error| StageError::failed(format!("cannot start {name}: {error}"));
        let listener = Listener::new().map_err(cannot)?;
        let mut running = Running::start(program, &listener.address, threads).map_err(cannot)?;
        let (start, patience) = (Instant::now(), program.patience());
        let mut is_told = false;
        let waited = patience.map_or(0, |patience| patience.as_secs());
        let socket = listener.accept(|| {
            if running.has_ended()? {
                let problem = format!(
                    "{name} ended before it connected: an app needs bevy_frugal_gi's `StagePlugin`, with its feature `stage`"
                );
                return Err(running.describe(&problem));
            }
            if !is_told && start.elapsed() > SILENCE {
                is_told = true;
                eprintln!("waiting for {name}: it builds or starts");
            }
            if patience.is_some_and(|patience| start.elapsed() > patience) {
                let problem = format!(
                    "{name} did not connect within {waited} s: an app needs bevy_frugal_gi's `StagePlugin`, with its feature `stage`; --patience waits longer"
                );
                return Err(running.describe(&problem));
            }
            Ok(())
        })?;
        socket.set_read_timeout(patience.map(|patience| patience + GRACE))?;
        socket.set_write_timeout(patience)?;
        let mut input = BufReader::new(socket.try_clone()?);
        let hello: Hello = receive(&mut input).map_err(|error| {
            running.describe(&format!("{name} does not speak as a stage: {error}"))
        })?;
        let here = Hello::here();
        if (hello.protocol, &hello.version) != (here.protocol, &here.version) {
            return Err(StageError::usage(format!(
                "{name} has bevy_frugal_gi {} (stage protocol {}), this is frugal {} (stage protocol {PROTOCOL}): build both from one version",
                hello.version, hello.protocol, here.version
            )));
        }
        Ok(Self {
            program: program.clone(),
            running,
            input,
            output: socket,
            hello,
            resident_bytes: 0,
            bytes_when_new: 0,
        })
    }

    /// Waits for the program's level: every knob of the app, the names of the opt-in ones, and the bytes of
    /// the extracted scene, if that is asked for.
    ///
    /// # Errors
    /// When there is none.
    pub(super) fn load(
        &mut self,
        scene: bool,
    ) -> Result<(KnobSpace, Vec<String>, Vec<u8>), StageError> {
        let request = Request::Load { seconds: self.patience_seconds(), scene };
        match self.exchange(&request)? {
            (Answer::Loaded { knobs, opt_in }, scene) => Ok((knobs, opt_in, scene)),
            (other, _) => Err(unexpected(&other)),
        }
    }

    /// Longest time for its level, seconds.
    pub(super) fn patience_seconds(&self) -> f64 {
        self.program.patience().map_or(f64::MAX, |patience| patience.as_secs_f64())
    }

    /// Sends a request; returns the answer, and the bytes that follow it.
    ///
    /// # Errors
    /// [`NoAnswer`].
    pub(super) fn exchange(&mut self, request: &Request) -> Result<(Answer, Vec<u8>), NoAnswer> {
        let Self { input, output, .. } = self;
        let reply = send(output, request)
            .and_then(|()| output.flush())
            .and_then(|()| receive::<Reply>(input))
            .and_then(|reply| {
                let mut bytes = Vec::new();
                if input.by_ref().take(reply.bytes).read_to_end(&mut bytes)? as u64 != reply.bytes {
                    return Err(io::ErrorKind::UnexpectedEof.into());
                }
                Ok((reply, bytes))
            });
        match reply {
            Ok((Reply { answer: Answer::Failed(error), .. }, _)) => Err(NoAnswer::Failed(error)),
            Ok((Reply { resident_bytes, answer, .. }, bytes)) => {
                self.resident_bytes = resident_bytes;
                Ok((answer, bytes))
            }
            Err(error) => {
                let name = self.program.name();
                if matches!(error.kind(), io::ErrorKind::WouldBlock | io::ErrorKind::TimedOut) {
                    let waited = self.patience_seconds();
                    let problem =
                        format!("{name} hangs: no answer for {waited} s; --patience waits longer");
                    return Err(NoAnswer::Hung(self.running.describe(&problem)));
                }
                let problem =
                    format!("{name} broke off ({error}): it crashed, or ran out of memory");
                Err(NoAnswer::Broken(self.running.describe(&problem)))
            }
        }
    }
}

/// The error of an answer to another request.
pub(super) fn unexpected(answer: &Answer) -> StageError {
    StageError::failed(format!("the renderer's process sent an unexpected answer: {answer:?}"))
}

/// Waits for one app.
struct Listener {
    /// What the app connects to: `127.0.0.1:PORT/TOKEN`.
    address: String,
    listener: TcpListener,
    token: String,
}

impl Listener {
    fn new() -> io::Result<Self> {
        let listener = TcpListener::bind((Ipv4Addr::LOCALHOST, 0))?;
        listener.set_nonblocking(true)?;
        let number =
            || rand::TryRng::try_next_u64(&mut rand::rngs::SysRng).map_err(io::Error::other);
        let token = format!("{:016x}{:016x}", number()?, number()?);
        let address = format!("{}/{token}", listener.local_addr()?);
        Ok(Self { address, listener, token })
    }

    /// The connection of who says the token, unless `give_up` returns an error before there is one.
    fn accept<E: From<io::Error>>(
        self,
        mut give_up: impl FnMut() -> Result<(), E>,
    ) -> Result<TcpStream, E> {
        loop {
            match self.listener.accept() {
                Ok((mut socket, _)) => {
                    socket.set_nonblocking(false)?;
                    socket.set_nodelay(true)?;
                    socket.set_read_timeout(Some(Duration::from_secs(1)))?;
                    let mut said = vec![0; self.token.len()];
                    if socket.read_exact(&mut said).is_ok() && said == self.token.as_bytes() {
                        return Ok(socket);
                    }
                }
                Err(error) if error.kind() == io::ErrorKind::WouldBlock => give_up()?,
                Err(error) => return Err(error.into()),
            }
            std::thread::sleep(PAUSE);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_who_knows_the_token_is_let_in() {
        let listener = Listener::new().expect("a socket");
        let (port, token) = listener.address.split_once('/').expect("a port and a token");
        assert_eq!(token.len(), 32);
        let says = |said: String| {
            let mut socket = TcpStream::connect(port).expect("a listener");
            socket.write_all(said.as_bytes()).expect("a listener");
            socket
        };
        let mut stranger = says("0".repeat(token.len()));
        let mut client = says(token.to_owned());
        let waits = || Err(io::Error::from(io::ErrorKind::TimedOut));
        let mut accepted = listener.accept(waits).expect("the client");
        let mut byte = [0];
        assert!(!matches!(stranger.read(&mut byte), Ok(1..)), "nobody speaks to it");
        accepted.write_all(b"!").expect("the client");
        client.read_exact(&mut byte).expect("a byte");
        drop(client);
        assert_eq!(accepted.read(&mut byte).expect("an end"), 0);
        let error = Listener::new().expect("a socket").accept(waits).expect_err("nobody comes");
        assert_eq!(error.kind(), io::ErrorKind::TimedOut);
    }
}
