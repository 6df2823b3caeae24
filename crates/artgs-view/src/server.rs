//! The page over HTTP, on loopback only.
//!
//! `GET` of `/`, the script, the style, `/scene.json` and the files that the scene names; `POST /corrections`. Paths are
//! looked up among those names, so no path reaches the file system.

use crate::bundle::{HTML, POLICY, SCRIPT, STYLE};
use crate::guard::{Asked, refusal};
use crate::{Page, Source, ViewError};
use artgs_io::{Corrections, write_corrections};
use std::io::{Cursor, Read};
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;
use tiny_http::{Header, Method, Request, Response};

/// Port that is tried first.
pub const DEFAULT_PORT: u16 = 8765;
/// Threads that answer, so that a slow reader holds nobody up.
const THREADS: usize = 4;
/// Bytes of corrections; 256 of either kind fit.
const MOST_BYTES: usize = 1 << 16;

/// A page that can be asked for.
pub struct Server {
    http: tiny_http::Server,
    port: u16,
    page: Page,
    corrections: Option<PathBuf>,
}

type Answer = Response<Box<dyn Read + Send>>;

impl Server {
    /// Listens on 127.0.0.1: at `port` (0: any free one), or without one at [`DEFAULT_PORT`] or, if that is taken, any.
    /// `corrections` is the folder to write `corrections.json` into; without it nothing can be written.
    pub fn bind(mut page: Page, port: Option<u16>, corrections: Option<PathBuf>) -> Result<Self, ViewError> {
        let listen = |port: u16| {
            tiny_http::Server::http(("127.0.0.1", port))
                .map_err(|e| ViewError::Listen { port, reason: e.to_string() })
        };
        let http = match port {
            Some(port) => listen(port)?,
            None => listen(DEFAULT_PORT).or_else(|_| listen(0))?,
        };
        let port = http.server_addr().to_ip().map_or(0, |a| a.port());
        page.scene.corrections = corrections.is_some();
        Ok(Self { http, port, page, corrections })
    }

    /// Where the page is.
    pub fn url(&self) -> String {
        format!("http://127.0.0.1:{}/", self.port)
    }

    /// Answers until `stop` is set, within a fifth of a second.
    pub fn run(&self, stop: &AtomicBool) {
        std::thread::scope(|scope| {
            for _ in 0..THREADS {
                scope.spawn(|| {
                    while !stop.load(Ordering::Relaxed) {
                        // An error is one of a single connection, or of a listener that is gone: then `stop` follows.
                        if let Ok(Some(request)) = self.http.recv_timeout(Duration::from_millis(200)) {
                            self.answer(request);
                        }
                    }
                });
            }
        });
    }

    fn answer(&self, mut request: Request) {
        let answer = self.respond(&mut request);
        // A reader that went away is no failure of ours.
        let _ = request.respond(answer);
    }

    fn respond(&self, request: &mut Request) -> Answer {
        let asked =
            Asked { host: value(request, "Host"), origin: value(request, "Origin"), site: value(request, "Sec-Fetch-Site") };
        if let Some(reason) = refusal(&asked, self.port) {
            return text(403, reason);
        }
        let path = request.url().split('?').next().unwrap_or("").to_string();
        match (request.method(), path.as_str()) {
            (Method::Get, path) => self.get(path),
            (Method::Post, "/corrections") => self.correct(request),
            _ => text(405, "only GET, and POST /corrections"),
        }
    }

    fn get(&self, path: &str) -> Answer {
        match path {
            "/" => body(HTML.as_bytes().to_vec(), "text/html; charset=utf-8"),
            "/viewer.js" => body(SCRIPT.as_bytes().to_vec(), "text/javascript; charset=utf-8"),
            "/viewer.css" => body(STYLE.as_bytes().to_vec(), "text/css; charset=utf-8"),
            "/scene.json" => body(self.page.scene_json().into_bytes(), "application/json"),
            _ => match path.strip_prefix("/files/").and_then(|name| Some((name, self.page.files.get(name)?))) {
                Some((name, source)) => file(name, source),
                None => text(404, "there is no such file"),
            },
        }
    }

    fn correct(&self, request: &mut Request) -> Answer {
        let Some(folder) = &self.corrections else { return text(403, "this page takes no corrections") };
        // A form of another page cannot send this type without being asked first, which is refused.
        let kind = value(request, "Content-Type").unwrap_or("").split(';').next().unwrap_or("").trim().to_string();
        if !kind.eq_ignore_ascii_case("application/json") {
            return text(415, "corrections are application/json");
        }
        if request.body_length().is_none_or(|n| n > MOST_BYTES) {
            return text(413, "corrections are 64 KiB at most, their length given");
        }
        let mut bytes = Vec::new();
        if request.as_reader().take(MOST_BYTES as u64).read_to_end(&mut bytes).is_err() {
            return text(400, "the corrections did not arrive");
        }
        let written = Corrections::parse(&bytes)
            .map_err(|reason| text(400, &reason))
            .and_then(|c| write_corrections(folder, &c).map_err(|e| text(500, &e.to_string())));
        match written {
            Ok(()) => text(200, "saved"),
            Err(answer) => answer,
        }
    }
}

fn value<'a>(request: &'a Request, name: &'static str) -> Option<&'a str> {
    request.headers().iter().find(|h| h.field.equiv(name)).map(|h| h.value.as_str())
}

fn file(name: &str, source: &Source) -> Answer {
    let kind = content_type(name);
    match source {
        Source::Bytes(bytes) => body(bytes.clone(), kind),
        Source::Path(path) => match std::fs::File::open(path) {
            Ok(file) => {
                let length = file.metadata().ok().and_then(|m| usize::try_from(m.len()).ok());
                finish(Response::new(200.into(), vec![], Box::new(file), length, None), kind)
            }
            Err(e) => text(404, &format!("{name}: {e}")),
        },
    }
}

pub(crate) fn content_type(name: &str) -> &'static str {
    match name.rsplit('.').next() {
        Some("png") => "image/png",
        Some("jpg" | "jpeg") => "image/jpeg",
        _ => "application/octet-stream",
    }
}

fn text(status: u16, message: &str) -> Answer {
    let bytes = format!("{message}\n").into_bytes();
    let length = bytes.len();
    let response = Response::new(status.into(), vec![], Box::new(Cursor::new(bytes)) as _, Some(length), None);
    finish(response, "text/plain; charset=utf-8")
}

fn body(bytes: Vec<u8>, kind: &'static str) -> Answer {
    let length = bytes.len();
    finish(Response::new(200.into(), vec![], Box::new(Cursor::new(bytes)), Some(length), None), kind)
}

fn finish(mut response: Answer, kind: &'static str) -> Answer {
    let headers = [
        ("Content-Type", kind),
        ("Content-Security-Policy", POLICY),
        ("X-Content-Type-Options", "nosniff"),
        ("Cross-Origin-Resource-Policy", "same-origin"),
        ("Referrer-Policy", "no-referrer"),
        ("Cache-Control", "no-store"),
    ];
    for header in headers.iter().filter_map(|(k, v)| Header::from_bytes(k.as_bytes(), v.as_bytes()).ok()) {
        response.add_header(header);
    }
    response
}
