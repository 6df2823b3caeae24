//! The page over HTTP, on loopback only.
//!
//! `GET` of `/`, the script, the style, `/scene.json` and the files that the scene names; `POST /corrections`; of a run
//! that is under way, `/live.json`, `/live/splats.spz` and `/live/parts.spz`. Paths are looked up among those names, so no path reaches the file system.

use crate::bundle::{HTML, POLICY, SCRIPT, STYLE};
use crate::guard::{Asked, refusal};
use crate::http::{self, Answer, Body, Request};
use crate::live::{Live, Tint};
use crate::{Page, Source, ViewError};
use artgs_io::{Corrections, write_corrections};
use std::net::{Ipv4Addr, TcpListener, TcpStream};
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::time::Duration;

/// Port that is tried first.
pub const DEFAULT_PORT: u16 = 8765;
/// Connections answered at once; a page needs six.
const MOST_CONNECTIONS: usize = 64;
/// Bytes of corrections; 256 of either kind fit.
const MOST_BYTES: usize = 1 << 16;
/// How often the end is looked for, and a new connection.
const BEAT: Duration = Duration::from_millis(10);

/// A page that can be asked for.
pub struct Server {
    listener: TcpListener,
    port: u16,
    page: Page,
    corrections: Option<PathBuf>,
    live: Option<Arc<Live>>,
}

impl Server {
    /// Listens on 127.0.0.1: at `port` (0: any free one), or without one at [`DEFAULT_PORT`] or, if that is taken, any.
    /// `corrections` is the folder to write `corrections.json` into; without it nothing can be written.
    pub fn bind(mut page: Page, port: Option<u16>, corrections: Option<PathBuf>) -> Result<Self, ViewError> {
        let listen = |port: u16| TcpListener::bind((Ipv4Addr::LOCALHOST, port));
        let refused = |port: u16| move |e: std::io::Error| ViewError::Listen { port, reason: e.to_string() };
        let listener = match port {
            Some(port) => listen(port).map_err(refused(port))?,
            None => listen(DEFAULT_PORT).or_else(|_| listen(0)).map_err(refused(DEFAULT_PORT))?,
        };
        listener.set_nonblocking(true).map_err(refused(port.unwrap_or(DEFAULT_PORT)))?;
        let port = listener.local_addr().map_err(refused(port.unwrap_or(DEFAULT_PORT)))?.port();
        page.scene.corrections = corrections.is_some();
        Ok(Self { listener, port, page, corrections, live: None })
    }

    /// Listens like [`Server::bind`] for a page that follows a run; nothing can be written.
    pub fn bind_live(live: Arc<Live>, port: Option<u16>) -> Result<Self, ViewError> {
        let mut page = Page::empty(live.name());
        page.place(live.placement());
        page.scene.live = true;
        Ok(Self { live: Some(live), ..Self::bind(page, port, None)? })
    }

    /// Where the page is.
    pub fn url(&self) -> String {
        format!("http://127.0.0.1:{}/", self.port)
    }

    /// Answers until `stop` is set, and then until the last answer is out.
    pub fn run(&self, stop: &AtomicBool) {
        let open = AtomicUsize::new(0);
        std::thread::scope(|scope| {
            while !stop.load(Ordering::Relaxed) {
                // Whatever else fails is a matter of one connection: the next may do.
                let Ok((stream, _)) = self.listener.accept() else {
                    std::thread::sleep(BEAT);
                    continue;
                };
                let busy = open.fetch_add(1, Ordering::Relaxed) >= MOST_CONNECTIONS;
                let open = &open;
                scope.spawn(move || {
                    // A peer that goes away is no failure of ours.
                    let _ = self.serve(stream, busy);
                    open.fetch_sub(1, Ordering::Relaxed);
                });
            }
        });
    }

    fn serve(&self, mut stream: TcpStream, busy: bool) -> std::io::Result<()> {
        stream.set_nonblocking(false)?;
        stream.set_nodelay(true)?;
        let answer = match busy {
            true => Answer::text(503, "too many connections"),
            false => {
                http::read(&mut stream, MOST_BYTES)?.map_or_else(|refused| refused, |request| self.respond(&request))
            }
        };
        let headers = [
            ("Content-Security-Policy", POLICY),
            ("X-Content-Type-Options", "nosniff"),
            ("Cross-Origin-Resource-Policy", "same-origin"),
            ("Referrer-Policy", "no-referrer"),
            ("Cache-Control", "no-store"),
        ];
        http::write(&mut stream, answer, &headers)
    }

    fn respond(&self, request: &Request) -> Answer {
        let asked = Asked {
            host: request.header("Host"),
            origin: request.header("Origin"),
            site: request.header("Sec-Fetch-Site"),
        };
        // A link elsewhere may lead here: that loads the page, but tells the other page nothing.
        let opened = request.header("Sec-Fetch-Mode") == Some("navigate") && request.path() == "/";
        let asked = if opened { Asked { site: None, ..asked } } else { asked };
        if let Some(reason) = refusal(&asked, self.port) {
            return Answer::text(403, reason);
        }
        match (request.method.as_str(), request.path()) {
            ("GET", path) => match &self.live {
                Some(live) if path.starts_with("/live") => look(live, request),
                _ => self.get(path),
            },
            ("POST", "/corrections") => self.correct(request),
            _ => Answer::text(405, "only GET, and POST /corrections"),
        }
    }

    fn get(&self, path: &str) -> Answer {
        match path {
            "/" => Answer::bytes(HTML.as_bytes(), "text/html; charset=utf-8"),
            "/viewer.js" => Answer::bytes(SCRIPT.as_bytes(), "text/javascript; charset=utf-8"),
            "/viewer.css" => Answer::bytes(STYLE.as_bytes(), "text/css; charset=utf-8"),
            "/scene.json" => Answer::bytes(self.page.scene_json().as_bytes(), "application/json"),
            _ => match path.strip_prefix("/files/").and_then(|name| Some((name, self.page.files.get(name)?))) {
                Some((name, source)) => file(name, source),
                None => Answer::text(404, "there is no such file"),
            },
        }
    }

    fn correct(&self, request: &Request) -> Answer {
        let Some(folder) = &self.corrections else { return Answer::text(403, "this page takes no corrections") };
        // A form of another page cannot send this type without being asked first, which is refused.
        let kind = request.header("Content-Type").unwrap_or("").split(';').next().unwrap_or("").trim();
        if !kind.eq_ignore_ascii_case("application/json") {
            return Answer::text(415, "corrections are application/json");
        }
        let written = Corrections::parse(&request.body)
            .map_err(|reason| Answer::text(400, &reason))
            .and_then(|c| write_corrections(folder, &c).map_err(|e| Answer::text(500, &e.to_string())));
        written.map_or_else(|refused| refused, |()| Answer::text(200, "saved"))
    }
}

fn look(live: &Live, request: &Request) -> Answer {
    let splats = |tint| match live.spz(tint) {
        Some(bytes) => Answer::bytes(&bytes, "application/octet-stream"),
        None => Answer::text(404, "there are no Gaussians to show yet"),
    };
    match request.path() {
        "/live.json" => Answer::bytes(live.json(request.number("since")).as_bytes(), "application/json"),
        "/live/splats.spz" => splats(Tint::Photo),
        "/live/parts.spz" => splats(Tint::Parts),
        _ => Answer::text(404, "there is no such file"),
    }
}

fn file(name: &str, source: &Source) -> Answer {
    let kind = match name.rsplit('.').next() {
        Some("png") => "image/png",
        Some("jpg" | "jpeg") => "image/jpeg",
        _ => "application/octet-stream",
    };
    match source {
        Source::Bytes(bytes) => Answer::bytes(bytes, kind),
        Source::Path(path) => match std::fs::File::open(path).and_then(|f| Ok((f.metadata()?.len(), f))) {
            Ok((length, file)) => Answer { status: 200, kind, body: Body::File(file, length) },
            Err(e) => Answer::text(404, &format!("{name}: {e}")),
        },
    }
}
