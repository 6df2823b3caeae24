//! The subset of HTTP/1.1 that a page on loopback needs: one request per connection, bodies of known length.
//!
//! Small servers with persistent connections and few threads block a browser that opens six connections; here every
//! connection has its own thread and ends with the answer.

use std::fs::File;
use std::io::{self, Read, Write};
use std::net::TcpStream;
use std::time::{Duration, Instant};

/// Bytes of a request without its body.
const MOST_HEAD: usize = 16 << 10;
const MOST_HEADERS: usize = 64;
/// A peer that takes nothing of an answer is disconnected after this time.
const STALLED: Duration = Duration::from_secs(20);
/// Time for a whole answer, and bytes per second that a peer must take beyond that.
const ANSWER: Duration = Duration::from_secs(60);
const SLOWEST: u64 = 100 << 10;
/// Time in which what a peer still sends is read after the answer.
const LINGER: Duration = Duration::from_millis(500);

/// A request.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(crate) struct Request {
    pub(crate) method: String,
    /// Path with the query.
    pub(crate) target: String,
    /// As sent; names are case-insensitive.
    pub(crate) headers: Vec<(String, String)>,
    pub(crate) body: Vec<u8>,
}

impl Request {
    /// Value of a header; none if missing, empty if it occurs several times, so that it matches nothing.
    pub(crate) fn header(&self, name: &str) -> Option<&str> {
        let mut found = self.headers.iter().filter(|(n, _)| n.eq_ignore_ascii_case(name));
        let (_, value) = found.next()?;
        Some(if found.next().is_some() { "" } else { value })
    }

    /// The path without the query.
    pub(crate) fn path(&self) -> &str {
        self.target.split('?').next().unwrap_or("")
    }

    /// A number of the query; 0 if missing or invalid.
    pub(crate) fn number(&self, key: &str) -> u64 {
        let query = self.target.split_once('?').map_or("", |(_, query)| query);
        let value = query.split('&').find_map(|pair| pair.strip_prefix(key)?.strip_prefix('='));
        value.and_then(|v| v.parse().ok()).unwrap_or(0)
    }
}

/// Content of an answer.
pub(crate) enum Body {
    Bytes(Vec<u8>),
    File(File, u64),
}

/// An answer.
pub(crate) struct Answer {
    pub(crate) status: u16,
    pub(crate) kind: &'static str,
    pub(crate) body: Body,
}

impl Answer {
    /// A line of text.
    pub(crate) fn text(status: u16, message: &str) -> Self {
        Self { status, kind: "text/plain; charset=utf-8", body: Body::Bytes(format!("{message}\n").into_bytes()) }
    }

    /// Bytes of a content type.
    pub(crate) fn bytes(bytes: &[u8], kind: &'static str) -> Self {
        Self { status: 200, kind, body: Body::Bytes(bytes.to_vec()) }
    }
}

/// Reads from a stream until a point in time.
struct Until<'a> {
    stream: &'a mut TcpStream,
    end: Instant,
}

impl Read for Until<'_> {
    fn read(&mut self, into: &mut [u8]) -> io::Result<usize> {
        let left = self.end.saturating_duration_since(Instant::now());
        if left.is_zero() {
            return Err(io::ErrorKind::TimedOut.into());
        }
        self.stream.set_read_timeout(Some(left))?;
        self.stream.read(into)
    }
}

/// True if a peer was too slow; systems differ in the kind of this error.
fn is_late(error: &io::Error) -> bool {
    matches!(error.kind(), io::ErrorKind::TimedOut | io::ErrorKind::WouldBlock)
}

/// Reads a request; `most` bounds the bytes of its body, `patience` the time of all of it. An inner `Err` is the answer to
/// an invalid request.
pub(crate) fn read(stream: &mut TcpStream, most: usize, patience: Duration) -> io::Result<Result<Request, Answer>> {
    let mut stream = Until { stream, end: Instant::now() + patience };
    let mut bytes = Vec::new();
    match read_until(&mut stream, most, &mut bytes) {
        // A peer that sent nothing expects no answer.
        Err(error) if is_late(&error) && !bytes.is_empty() => Ok(Err(Answer::text(408, "the request is too slow"))),
        read => read,
    }
}

fn read_until(stream: &mut Until<'_>, most: usize, bytes: &mut Vec<u8>) -> io::Result<Result<Request, Answer>> {
    let mut piece = [0u8; 4096];
    loop {
        let count = stream.read(&mut piece)?;
        if count == 0 {
            return Err(io::ErrorKind::UnexpectedEof.into());
        }
        bytes.extend(&piece[..count]);
        match head(bytes) {
            Err(reason) => return Ok(Err(Answer::text(400, &reason))),
            Ok(None) if bytes.len() > MOST_HEAD => return Ok(Err(Answer::text(431, "the headers are too long"))),
            Ok(None) => {}
            Ok(Some((length, mut request))) => {
                let rest = bytes[length..].to_vec();
                return Ok(body(stream, &request, rest, most)?.map(|body| {
                    request.body = body;
                    request
                }));
            }
        }
    }
}

/// Length of the head and its content, once it is complete.
fn head(bytes: &[u8]) -> Result<Option<(usize, Request)>, String> {
    let mut headers = [httparse::EMPTY_HEADER; MOST_HEADERS];
    let mut parsed = httparse::Request::new(&mut headers);
    match parsed.parse(bytes) {
        Err(e) => Err(format!("not HTTP: {e}")),
        Ok(httparse::Status::Partial) => Ok(None),
        Ok(httparse::Status::Complete(length)) => {
            let text = |v: &[u8]| String::from_utf8_lossy(v).into_owned();
            let request = Request {
                method: parsed.method.unwrap_or("").into(),
                target: parsed.path.unwrap_or("").into(),
                headers: parsed.headers.iter().map(|h| (h.name.into(), text(h.value))).collect(),
                body: Vec::new(),
            };
            Ok(Some((length, request)))
        }
    }
}

fn body(
    stream: &mut Until<'_>,
    request: &Request,
    mut bytes: Vec<u8>,
    most: usize,
) -> io::Result<Result<Vec<u8>, Answer>> {
    if request.header("Transfer-Encoding").is_some() {
        return Ok(Err(Answer::text(411, "the length of the body must be given")));
    }
    let Some(length) = request.header("Content-Length") else { return Ok(Ok(Vec::new())) };
    let Ok(length) = length.parse::<usize>() else { return Ok(Err(Answer::text(400, "Content-Length is no number"))) };
    if length > most {
        return Ok(Err(Answer::text(413, &format!("the body is above {most} bytes"))));
    }
    bytes.truncate(length);
    let missing = (length - bytes.len()) as u64;
    let got = stream.take(missing).read_to_end(&mut bytes)? as u64;
    if got < missing {
        return Err(io::ErrorKind::UnexpectedEof.into());
    }
    Ok(Ok(bytes))
}

/// Writes an answer with additional headers; `sent` is called after every piece that the peer takes.
pub(crate) fn write(
    stream: &mut TcpStream,
    answer: Answer,
    headers: &[(&str, &str)],
    sent: &dyn Fn(),
) -> io::Result<()> {
    /// Bytes per piece.
    const PIECE: usize = 64 << 10;
    let length = match &answer.body {
        Body::Bytes(bytes) => bytes.len() as u64,
        Body::File(_, length) => *length,
    };
    let mut head = format!(
        "HTTP/1.1 {} {}\r\nContent-Type: {}\r\nContent-Length: {length}\r\nConnection: close\r\n",
        answer.status,
        reason(answer.status),
        answer.kind
    );
    headers.iter().for_each(|(name, value)| head += &format!("{name}: {value}\r\n"));
    let (mut bytes, mut file) = (&b""[..], None);
    match &answer.body {
        Body::Bytes(all) => bytes = all,
        Body::File(opened, length) => file = Some(opened.take(*length)),
    }
    let end = Instant::now() + ANSWER + Duration::from_secs(length / SLOWEST);
    stream.set_write_timeout(Some(STALLED))?;
    let mut content = (head + "\r\n").into_bytes();
    while !content.is_empty() {
        stream.write_all(&content)?;
        sent();
        if Instant::now() > end {
            return Err(io::ErrorKind::TimedOut.into());
        }
        content.resize(PIECE, 0);
        let count = match &mut file {
            Some(file) => file.read(&mut content)?,
            None => bytes.read(&mut content)?,
        };
        content.truncate(count);
    }
    stream.flush()
}

/// Closes a connection after its answer. Unread bytes of the peer would reset it before the answer arrives.
pub(crate) fn close(stream: &mut TcpStream) -> io::Result<()> {
    stream.shutdown(std::net::Shutdown::Write)?;
    let rest = Until { stream, end: Instant::now() + LINGER };
    io::copy(&mut rest.take(1 << 20), &mut io::sink()).map(|_| ())
}

fn reason(status: u16) -> &'static str {
    match status {
        200 => "OK",
        202 => "Accepted",
        403 => "Forbidden",
        404 => "Not Found",
        405 => "Method Not Allowed",
        408 => "Request Timeout",
        409 => "Conflict",
        411 => "Length Required",
        413 => "Content Too Large",
        415 => "Unsupported Media Type",
        431 => "Request Header Fields Too Large",
        500 => "Internal Server Error",
        503 => "Service Unavailable",
        _ => "Bad Request",
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn heads_may_be_partial_and_repeated_headers_match_nothing() {
        let text = b"POST /a/b?c=d HTTP/1.1\r\nHost: x:1\r\nORIGIN: a\r\nOrigin: b\r\n\r\nrest";
        assert_eq!(head(&text[..30]).unwrap(), None);
        let (length, request) = head(text).unwrap().unwrap();
        assert_eq!(&text[length..], b"rest");
        assert_eq!((request.method.as_str(), request.path()), ("POST", "/a/b"));
        assert_eq!((request.number("c"), request.number("d")), (0, 0));
        let asked = Request { target: "/live.json?a=7&since=42&b=-1".into(), ..Request::default() };
        assert_eq!(["since", "a", "b", "sinc"].map(|key| asked.number(key)), [42, 7, 0, 0]);
        assert_eq!((request.header("host"), request.header("origin")), (Some("x:1"), Some("")));
        assert_eq!(request.header("Content-Length"), None);
        assert!(head(b"\x16\x03\x01\x02\x00").unwrap_err().contains("not HTTP"));
    }

    /// Both ends of a connection, that of the peer first.
    fn connection() -> (TcpStream, TcpStream) {
        let listener = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
        let peer = TcpStream::connect(listener.local_addr().unwrap()).unwrap();
        (peer, listener.accept().unwrap().0)
    }

    #[test]
    fn a_peer_that_sends_byte_by_byte_has_no_more_time_than_others() {
        for start in ["", "POST / HTTP/1.1\r\nContent-Length: 9999\r\n\r\n"] {
            let (mut peer, mut stream) = connection();
            peer.write_all(start.as_bytes()).unwrap();
            let slow = std::thread::spawn(move || {
                while peer.write_all(b"G").is_ok() {
                    std::thread::sleep(Duration::from_millis(20));
                }
            });
            let begun = Instant::now();
            let answer = read(&mut stream, 1 << 16, Duration::from_millis(200)).unwrap().unwrap_err();
            assert!(answer.status == 408 && begun.elapsed() < Duration::from_secs(2), "{:?}", begun.elapsed());
            // The same after an answer: the connection is closed although bytes keep coming.
            assert!(close(&mut stream).is_err_and(|e| is_late(&e)) && begun.elapsed() < Duration::from_secs(4));
            drop(stream);
            slow.join().unwrap();
        }
        let (peer, mut stream) = connection();
        assert!(read(&mut stream, 0, Duration::from_millis(50)).is_err_and(|e| is_late(&e)), "a silent peer");
        drop(peer);
    }

    #[test]
    fn long_answers_arrive_whole() {
        let bytes: Vec<u8> = (0..300_000_u32).map(|i| i as u8).collect();
        let mut file = tempfile::tempfile().unwrap();
        file.write_all(&bytes).unwrap();
        std::io::Seek::rewind(&mut file).unwrap();
        for body in [Body::Bytes(bytes.clone()), Body::File(file, bytes.len() as u64)] {
            let (mut peer, mut stream) = connection();
            let reader = std::thread::spawn(move || {
                let mut all = Vec::new();
                peer.read_to_end(&mut all).map(|_| all)
            });
            let pieces = std::cell::Cell::new(0);
            let answer = Answer { status: 200, kind: "x/y", body };
            write(&mut stream, answer, &[], &|| pieces.set(pieces.get() + 1)).unwrap();
            close(&mut stream).unwrap();
            drop(stream);
            let all = reader.join().unwrap().unwrap();
            assert!(all.ends_with(&bytes) && pieces.get() == 6, "{} bytes, {} pieces", all.len(), pieces.get());
        }
    }
}
