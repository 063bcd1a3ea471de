//! The socket that an app connects to.

use std::ffi::OsString;
use std::io;
use std::time::Duration;

use bevy_frugal_gi::stage::protocol::Socket;

/// Pause between looks for a connection.
const PAUSE: Duration = Duration::from_millis(10);

/// Waits for one app.
pub(super) struct Listener {
    /// What the app connects to.
    pub address: OsString,
    #[cfg(unix)]
    listener: std::os::unix::net::UnixListener,
    /// Only this user may enter it. Removed when this ends.
    #[cfg(unix)]
    _folder: tempfile::TempDir,
    #[cfg(not(unix))]
    listener: std::net::TcpListener,
    #[cfg(not(unix))]
    token: String,
}

#[cfg(unix)]
impl Listener {
    pub(super) fn new() -> io::Result<Self> {
        use std::os::unix::fs::PermissionsExt as _;

        let user_alone = std::fs::Permissions::from_mode(0o700);
        let folder =
            tempfile::Builder::new().prefix("frugal-").permissions(user_alone).tempdir()?;
        let address = folder.path().join("stage");
        let listener = std::os::unix::net::UnixListener::bind(&address)?;
        listener.set_nonblocking(true)?;
        Ok(Self { address: address.into(), listener, _folder: folder })
    }

    /// The app's connection, unless `give_up` returns an error before there is one.
    pub(super) fn accept<E: From<io::Error>>(
        self,
        mut give_up: impl FnMut() -> Result<(), E>,
    ) -> Result<Socket, E> {
        loop {
            match self.listener.accept() {
                Ok((socket, _)) => {
                    socket.set_nonblocking(false)?;
                    return Ok(socket);
                }
                Err(error) if error.kind() == io::ErrorKind::WouldBlock => give_up()?,
                Err(error) => return Err(error.into()),
            }
            std::thread::sleep(PAUSE);
        }
    }
}

#[cfg(not(unix))]
impl Listener {
    pub(super) fn new() -> io::Result<Self> {
        let listener = std::net::TcpListener::bind((std::net::Ipv4Addr::LOCALHOST, 0))?;
        listener.set_nonblocking(true)?;
        let mut number = || rand::TryRng::try_next_u64(&mut rand::rngs::SysRng);
        let (low, high) =
            (number().map_err(io::Error::other)?, number().map_err(io::Error::other)?);
        let token = format!("{high:016x}{low:016x}");
        let address = format!("{}/{token}", listener.local_addr()?).into();
        Ok(Self { address, listener, token })
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
                    socket.set_read_timeout(Some(Duration::from_secs(1)))?;
                    let mut said = vec![0; self.token.len()];
                    let is_read = io::Read::read_exact(&mut socket, &mut said).is_ok();
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

#[cfg(all(test, unix))]
mod tests {
    use std::os::unix::fs::PermissionsExt as _;
    use std::path::PathBuf;

    use super::*;

    #[test]
    fn only_the_user_may_enter_and_nothing_is_left_behind() {
        let listener = Listener::new().expect("a socket");
        let folder = PathBuf::from(&listener.address).parent().expect("a folder").to_owned();
        let mode = folder.metadata().expect("a folder").permissions().mode();
        assert_eq!(mode & 0o777, 0o700);
        let client = Socket::connect(&listener.address).expect("a listener");
        let waits = || Err(io::Error::from(io::ErrorKind::TimedOut));
        let accepted = listener.accept(waits).expect("the client");
        assert!(!folder.exists(), "it is needed for one connection");
        drop(client);
        let mut byte = [0];
        let read = io::Read::read(&mut { accepted }, &mut byte);
        assert_eq!(read.expect("an end"), 0);
        let error = Listener::new().expect("a socket").accept(waits).expect_err("nobody comes");
        assert_eq!(error.kind(), io::ErrorKind::TimedOut);
    }
}
