//! The socket between the tool and an app: on Unix a file in a folder that is the user's alone,
//! elsewhere a port of this machine, where the app first says the token that its environment holds.

use std::ffi::OsStr;
use std::io;

/// A connection.
#[cfg(unix)]
pub type Socket = std::os::unix::net::UnixStream;

/// A connection.
#[cfg(not(unix))]
pub type Socket = std::net::TcpStream;

/// Connects to the tool at the file `address`.
#[cfg(unix)]
pub(in crate::stage) fn connect(address: &OsStr) -> io::Result<Socket> {
    Socket::connect(address)
}

/// Connects to the tool at `address`: `127.0.0.1:PORT/TOKEN`.
#[cfg(not(unix))]
pub(in crate::stage) fn connect(address: &OsStr) -> io::Result<Socket> {
    let unusable = || io::Error::new(io::ErrorKind::InvalidInput, "not a stage's address");
    let (port, token) =
        address.to_str().and_then(|text| text.split_once('/')).ok_or_else(unusable)?;
    let mut socket = Socket::connect(port)?;
    io::Write::write_all(&mut socket, token.as_bytes())?;
    Ok(socket)
}
