//! Open connections of the server: a limited number, of which those that keep the server waiting make room for new ones.

use std::collections::BTreeMap;
use std::io;
use std::net::{Shutdown, TcpStream};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

/// Largest number of simultaneous connections; a page needs six.
pub(crate) const MOST_CONNECTIONS: usize = 64;
/// A peer that takes nothing of its answer for this time makes room, too.
const STALLED: Duration = Duration::from_secs(2);

/// All open connections. The server is on loopback, so all of them are of one peer: the oldest one that has not completed
/// its request is closed for a new one.
#[derive(Default)]
pub(crate) struct Connections {
    open: Mutex<Open>,
}

#[derive(Default)]
struct Open {
    /// By age, the oldest first.
    by_age: BTreeMap<u64, Connection>,
    next: u64,
}

struct Connection {
    stream: TcpStream,
    state: Waiting,
}

/// What a connection waits for.
#[derive(Clone, Copy, PartialEq)]
enum Waiting {
    /// A request, or the end of the connection.
    Peer,
    /// An answer, of which a piece was sent last at this time.
    Answer(Instant),
}

/// A connection that is counted until this value is dropped.
pub(crate) struct Admitted<'a> {
    all: &'a Connections,
    id: u64,
}

impl Connections {
    /// Counts a new connection; none if there are too many and all others are being answered.
    pub(crate) fn admit(&self, stream: &TcpStream) -> io::Result<Option<Admitted<'_>>> {
        let stream = stream.try_clone()?;
        let mut open = self.open();
        if open.by_age.len() >= MOST_CONNECTIONS {
            let Some(id) = open.least_useful() else { return Ok(None) };
            if let Some(closed) = open.by_age.remove(&id) {
                // Its thread then reads the end of the connection. It may have ended by itself.
                let _ = closed.stream.shutdown(Shutdown::Both);
            }
        }
        let id = open.next;
        open.next += 1;
        open.by_age.insert(id, Connection { stream, state: Waiting::Peer });
        Ok(Some(Admitted { all: self, id }))
    }

    /// Closes those that are not being answered.
    pub(crate) fn close_waiting(&self) {
        let open = self.open();
        let waiting = open.by_age.values().filter(|c| c.state == Waiting::Peer);
        // They may have ended by themselves.
        waiting.for_each(|c| drop(c.stream.shutdown(Shutdown::Both)));
    }

    /// A poisoned lock is used: no code that holds it can leave inconsistent data.
    fn open(&self) -> MutexGuard<'_, Open> {
        self.open.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Open {
    fn least_useful(&self) -> Option<u64> {
        let waiting = self.by_age.iter().find(|(_, c)| c.state == Waiting::Peer);
        let stalled = |c: &Connection| matches!(c.state, Waiting::Answer(since) if since.elapsed() >= STALLED);
        waiting.or_else(|| self.by_age.iter().find(|(_, c)| stalled(c))).map(|(id, _)| *id)
    }
}

impl Admitted<'_> {
    /// Its request is complete, or a piece of the answer was sent.
    pub(crate) fn is_answered(&self) {
        self.set(Waiting::Answer(Instant::now()));
    }

    /// The answer was sent.
    pub(crate) fn is_done(&self) {
        self.set(Waiting::Peer);
    }

    fn set(&self, state: Waiting) {
        if let Some(own) = self.all.open().by_age.get_mut(&self.id) {
            own.state = state;
        }
    }
}

impl Drop for Admitted<'_> {
    fn drop(&mut self) {
        self.all.open().by_age.remove(&self.id);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::Read;
    use std::net::{Ipv4Addr, TcpListener};

    #[test]
    fn the_oldest_without_a_request_makes_room_and_none_with_an_answer() {
        let listener = TcpListener::bind((Ipv4Addr::LOCALHOST, 0)).unwrap();
        let address = listener.local_addr().unwrap();
        let pair = || (TcpStream::connect(address).unwrap(), listener.accept().unwrap().0);
        let all = Connections::default();
        let mut pairs: Vec<_> = (0..=MOST_CONNECTIONS).map(|_| pair()).collect();
        let (last, last_served) = pairs.pop().unwrap();
        let held: Vec<_> = pairs.iter().map(|(_, served)| all.admit(served).unwrap().unwrap()).collect();
        held.iter().for_each(Admitted::is_answered);
        assert!(all.admit(&last_served).unwrap().is_none());
        held[7].is_done();
        held[9].is_done();
        let admitted = all.admit(&last_served).unwrap().unwrap();
        assert_eq!(pairs[7].0.read(&mut [0]).unwrap(), 0, "closed");
        pairs[9].0.set_read_timeout(Some(Duration::from_millis(20))).unwrap();
        assert!(pairs[9].0.read(&mut [0]).is_err(), "open");
        all.close_waiting();
        assert_eq!(pairs[9].0.read(&mut [0]).unwrap(), 0, "closed");
        drop((admitted, last));
        assert_eq!(all.open().by_age.len(), MOST_CONNECTIONS - 1);
        drop(held);
        assert!(all.open().by_age.is_empty());
    }
}
