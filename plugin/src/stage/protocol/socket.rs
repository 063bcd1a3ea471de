//! The socket between the tool and an app: a port of this machine, where the app first says the token
//! that its environment holds.

use std::ffi::OsStr;
use std::io::{self, Write as _};

/// A connection.
pub type Socket = std::net::TcpStream;

/// Connects to the tool at `address`: `127.0.0.1:PORT/TOKEN`.
pub(in crate::stage) fn connect(address: &OsStr) -> io::Result<Socket> {
    let unusable = || io::Error::new(io::ErrorKind::InvalidInput, "not a stage's address");
    let (port, token) =
        address.to_str().and_then(|text| text.split_once('/')).ok_or_else(unusable)?;
    let mut socket = Socket::connect(port)?;
    // Replies are short and waited for.
    socket.set_nodelay(true)?;
    socket.write_all(token.as_bytes())?;
    Ok(socket)
}
