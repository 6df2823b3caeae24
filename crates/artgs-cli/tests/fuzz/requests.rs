//! Requests to the viewer's server, over a connection.

use artgs_view::{Page, Server};
use std::fs;
use std::io::{Read, Write};
use std::net::{Shutdown, TcpStream};
use std::path::Path;
use std::sync::OnceLock;
use std::sync::atomic::AtomicBool;
use std::time::Duration;

/// Valid requests, of which one is mutated per case. The port is that of no server; its header is refused, after the parser.
pub(crate) const REQUESTS: [(&str, &str); 4] = [
    ("get.txt", "GET /scene.json?since=3 HTTP/1.1\r\nHost: 127.0.0.1:PORT\r\nAccept: */*\r\n\r\n"),
    (
        "head.txt",
        "GET / HTTP/1.1\r\nHost: localhost:PORT\r\nOrigin: http://localhost:PORT\r\nSec-Fetch-Site: same-origin\r\n\r\n",
    ),
    ("file.txt", "GET /files/../../etc/passwd HTTP/1.1\r\nHost: 127.0.0.1:PORT\r\n\r\n"),
    (
        "post.txt",
        "POST /corrections HTTP/1.1\r\nHost: 127.0.0.1:PORT\r\nOrigin: http://127.0.0.1:PORT\r\nContent-Type: application/json\r\n\
         Content-Length: 44\r\n\r\n{\"format\": \"artgs-corrections\", \"version\": 1}",
    ),
];

/// The port of a server that runs as long as the process.
fn port() -> &'static str {
    static PORT: OnceLock<String> = OnceLock::new();
    PORT.get_or_init(|| {
        let folder = tempfile::tempdir().unwrap().keep();
        let server = Server::bind(Page::empty("lamp"), Some(0), Some(folder)).unwrap();
        let port = server.url().trim_end_matches('/').rsplit(':').next().unwrap().to_string();
        std::thread::spawn(move || server.run(&AtomicBool::new(false)));
        port
    })
}

/// Sends every request of the folder; the server must answer the last one, which is valid.
pub(crate) fn send(dir: &Path) {
    let good = REQUESTS[0].1.replace("PORT", port());
    for (name, _) in REQUESTS {
        let bytes = fs::read(dir.join(name)).unwrap();
        if bytes != REQUESTS.iter().find(|(n, _)| *n == name).unwrap().1.as_bytes() {
            let text = String::from_utf8(bytes).map(|text| text.replace("PORT", port()).into_bytes());
            // What is refused may end the connection at any time.
            let _ = ask(&text.unwrap_or_else(|e| e.into_bytes()));
        }
    }
    let answer = ask(good.as_bytes()).unwrap();
    assert!(answer.starts_with(b"HTTP/1.1 200"), "{}", String::from_utf8_lossy(&answer));
}

fn ask(request: &[u8]) -> std::io::Result<Vec<u8>> {
    let mut stream = TcpStream::connect(format!("127.0.0.1:{}", port()))?;
    stream.set_read_timeout(Some(Duration::from_secs(5)))?;
    stream.write_all(request)?;
    stream.shutdown(Shutdown::Write)?;
    let mut answer = Vec::new();
    stream.read_to_end(&mut answer)?;
    Ok(answer)
}
