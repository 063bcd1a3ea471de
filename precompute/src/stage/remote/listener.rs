//! The socket that an app connects to.

use std::io::{self, Read as _};
use std::net::{Ipv4Addr, TcpListener};
use std::time::Duration;

use bevy_frugal_gi::stage::protocol::Socket;
use rand::TryRng as _;
use rand::rngs::SysRng;

/// Pause between looks for a connection.
const PAUSE: Duration = Duration::from_millis(10);

/// Waits for one app.
pub(super) struct Listener {
    listener: TcpListener,
    /// Other users of the machine do not know it.
    token: String,
}

impl Listener {
    pub(super) fn new() -> io::Result<Self> {
        let listener = TcpListener::bind((Ipv4Addr::LOCALHOST, 0))?;
        listener.set_nonblocking(true)?;
        let token = SysRng.try_next_u64().map_err(io::Error::other)?;
        let token = format!("{token:016x}");
        Ok(Self { listener, token })
    }

    /// What the app connects to.
    pub(super) fn address(&self) -> io::Result<String> {
        Ok(format!("{}/{}", self.listener.local_addr()?, self.token))
    }

    /// The connection of who says the token, unless `give_up` returns an error before there is one.
    pub(super) fn accept<E: From<io::Error>>(
        self,
        mut give_up: impl FnMut() -> Result<(), E>,
    ) -> Result<Socket, E> {
        loop {
            match self.listener.accept() {
                Ok((mut socket, _)) => {
                    socket.set_nonblocking(false)?;
                    socket.set_nodelay(true)?;
                    socket.set_read_timeout(Some(Duration::from_secs(1)))?;
                    let mut said = vec![0; self.token.len()];
                    let is_read = socket.read_exact(&mut said).is_ok();
                    if is_read && said == self.token.as_bytes() {
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
    use std::io::Write as _;

    use super::*;

    #[test]
    fn only_who_says_the_token_is_accepted() {
        let listener = Listener::new().expect("a socket");
        let address = listener.address().expect("a port");
        let (port, token) = address.split_once('/').expect("a token");
        let connect = |said: &str| {
            let mut socket = Socket::connect(port).expect("a listener");
            socket.write_all(said.as_bytes()).expect("room");
            socket
        };
        let _strangers = (connect(""), connect(&token.replace(|_| true, "x")));
        let mut client = connect(token);
        client.write_all(b"!").expect("room");
        let waits = || Err(io::Error::from(io::ErrorKind::TimedOut));
        let mut accepted = listener.accept(waits).expect("the client");
        let mut byte = [0];
        accepted.read_exact(&mut byte).expect("what follows the token");
        assert_eq!(byte, *b"!");
        let error = Listener::new().expect("a socket").accept(waits).expect_err("nobody comes");
        assert_eq!(error.kind(), io::ErrorKind::TimedOut);
    }
}
