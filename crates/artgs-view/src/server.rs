//! Serves the page over HTTP, on loopback only.
//!
//! `GET` of `/`, the script, the style, `/scene.json` and the files that the scene names; of a run, `/live.json`,
//! `/live/splats.spz` and `/live/parts.spz`; `GET` and `POST` of `/corrections`; `POST` of `/rerun` to start a run, and of
//! `/box` to save the box of the object. Paths are looked up among those names, so no request path reaches the file system.

use crate::bundle::{HTML, POLICY, SCRIPT, STYLE};
use crate::connections::{Admitted, Connections};
use crate::guard::{Asked, refusal};
use crate::http::{self, Answer, Body, Request};
use crate::live::{Live, Tint};
use crate::pending::pending;
use crate::{Page, SceneRerun, Source, ViewError};
use artgs_io::folder_lock::LockError;
use artgs_io::{BoxBounds, Corrections, FolderLock, read_corrections, write_corrections};
use std::net::{Ipv4Addr, TcpListener, TcpStream};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

/// Default port.
pub(crate) const DEFAULT_PORT: u16 = 8765;
/// Largest size of a request body, bytes; 256 corrections of each kind fit.
const MOST_BYTES: usize = 1 << 16;
/// Time from the start of a connection to the end of its request.
const PATIENCE: Duration = Duration::from_secs(10);
/// Interval at which the server polls for new connections and for its end.
const BEAT: Duration = Duration::from_millis(10);

/// A run started from the page: reports its progress and returns the new page, or the reason of its failure.
pub type Rerun<'a> = dyn Fn(&Arc<Live>) -> Result<Page, String> + Send + Sync + 'a;

/// A server for one page.
pub struct Server {
    listener: TcpListener,
    port: u16,
    shown: Mutex<Shown>,
    corrections: Option<PathBuf>,
    /// The run that the page can start, or why it cannot.
    rerun: Option<Result<Box<Rerun<'static>>, String>>,
    /// File of the box that the page edits.
    box_file: Option<PathBuf>,
}

/// Content that the server shows.
struct Shown {
    page: Arc<Page>,
    /// The active run, or the last one.
    live: Option<Arc<Live>>,
}

impl Server {
    /// Listens on 127.0.0.1: at `port` (0: any free one); without `port` at 8765 or, if that is in use, at any.
    /// `corrections` is the folder for `corrections.json`; without it the server accepts no corrections.
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
        let shown = Mutex::new(Shown { page: Arc::new(page), live: None });
        Ok(Self { listener, port, shown, corrections, rerun: None, box_file: None })
    }

    /// Listens like [`Server::bind`] with a page that follows a run, without corrections.
    pub fn bind_live(live: Arc<Live>, port: Option<u16>) -> Result<Self, ViewError> {
        let mut page = Page::empty(live.name());
        page.place(live.placement());
        page.scene.live = true;
        let server = Self::bind(page, port, None)?;
        server.shown().live = Some(live);
        Ok(server)
    }

    /// Lets the page start a run; `Err` says why no run can be started.
    pub fn with_rerun(mut self, rerun: Result<Box<Rerun<'static>>, String>) -> Self {
        self.rerun = Some(rerun);
        let page = Page::clone(&self.shown().page);
        self.show(page);
        self
    }

    /// Lets the page save the box of the object in a file; `Err` says why it cannot. Only for pages with a box.
    pub fn with_box(mut self, file: Result<PathBuf, String>) -> Self {
        let mut page = Page::clone(&self.shown().page);
        if let Some(edited) = &mut page.scene.object_box {
            edited.file = file.as_ref().ok().map(|path| path.display().to_string());
            edited.refused = file.as_ref().err().cloned();
            self.box_file = file.ok();
        }
        self.show(page);
        self
    }

    /// Replaces the page for later requests.
    fn show(&self, mut page: Page) {
        page.scene.corrections = self.corrections.is_some();
        let refused = self.rerun.as_ref().map(|r| r.as_ref().err().cloned());
        page.scene.rerun = refused.map(|refused| SceneRerun { refused });
        self.shown().page = Arc::new(page);
    }

    /// Executes a run while pages follow it; then they show its result. None if another run is active, else the outcome.
    pub fn follow(&self, job: &Rerun<'_>) -> Option<Result<(), String>> {
        let live = self.begin()?;
        Some(self.execute(&live, job))
    }

    /// True while a run is active.
    pub fn is_busy(&self) -> bool {
        self.shown().live.as_ref().is_some_and(|live| live.is_running())
    }

    /// Marks a run as active; none if one already is.
    fn begin(&self) -> Option<Arc<Live>> {
        let mut shown = self.shown();
        if shown.live.as_ref().is_some_and(|live| live.is_running()) {
            return None;
        }
        let scene = &shown.page.scene;
        let live = Arc::new(Live::new(&scene.name, scene.placement.unwrap_or_default()));
        shown.live = Some(Arc::clone(&live));
        Some(live)
    }

    fn execute(&self, live: &Arc<Live>, job: &Rerun<'_>) -> Result<(), String> {
        // A panic of the run must not end the server.
        let made = catch_unwind(AssertUnwindSafe(|| job(live)));
        let made = made.unwrap_or_else(|_| Err("the run stopped because of an error in this program".into()));
        let outcome = made.map(|page| self.show(page));
        live.finish(outcome.clone());
        outcome
    }

    /// A poisoned lock is used: no code that holds it can leave inconsistent data.
    fn shown(&self) -> MutexGuard<'_, Shown> {
        self.shown.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// URL of the page.
    pub fn url(&self) -> String {
        format!("http://127.0.0.1:{}/", self.port)
    }

    /// Answers requests until `stop` is set, then finishes open answers.
    pub fn run(&self, stop: &AtomicBool) {
        let open = Connections::default();
        std::thread::scope(|scope| {
            while !stop.load(Ordering::Relaxed) {
                // Other errors concern only one connection.
                let Ok((stream, _)) = self.listener.accept() else {
                    std::thread::sleep(BEAT);
                    continue;
                };
                let Ok(admitted) = open.admit(&stream) else { continue };
                scope.spawn(move || {
                    // A peer may disconnect at any time.
                    let _ = self.serve(stream, admitted);
                });
            }
            open.close_waiting();
        });
    }

    /// Answers one request. A connection that was not admitted is answered without being read.
    fn serve(&self, mut stream: TcpStream, admitted: Option<Admitted<'_>>) -> std::io::Result<()> {
        stream.set_nonblocking(false)?;
        stream.set_nodelay(true)?;
        let mut started = None;
        let answer = match &admitted {
            None => Answer::text(503, "too many connections"),
            Some(own) => {
                let request = http::read(&mut stream, MOST_BYTES, PATIENCE)?;
                own.is_answered();
                request.map_or_else(|refused| refused, |request| self.respond(&request, &mut started))
            }
        };
        let headers = [
            ("Content-Security-Policy", POLICY),
            ("X-Content-Type-Options", "nosniff"),
            ("Cross-Origin-Resource-Policy", "same-origin"),
            ("Referrer-Policy", "no-referrer"),
            ("Cache-Control", "no-store"),
        ];
        let sent = || admitted.iter().for_each(Admitted::is_answered);
        sent();
        let written = http::write(&mut stream, answer, &headers, &sent).and_then(|()| {
            admitted.iter().for_each(Admitted::is_done);
            http::close(&mut stream)
        });
        // A run that was started is no connection any more.
        drop((stream, admitted));
        // The run uses the thread of the request that started it.
        if let (Some(live), Some(Ok(job))) = (started, &self.rerun) {
            // Pages read the outcome from `live`.
            let _ = self.execute(&live, job);
        }
        written
    }

    fn respond(&self, request: &Request, started: &mut Option<Arc<Live>>) -> Answer {
        let asked = Asked {
            host: request.header("Host"),
            origin: request.header("Origin"),
            site: request.header("Sec-Fetch-Site"),
        };
        // A link on another site may open the page: the other site learns nothing from that.
        let opened = request.header("Sec-Fetch-Mode") == Some("navigate") && request.path() == "/";
        let asked = if opened { Asked { site: None, ..asked } } else { asked };
        if let Some(reason) = refusal(&asked, self.port) {
            return Answer::text(403, reason);
        }
        match (request.method.as_str(), request.path()) {
            ("GET", path) => {
                let (page, live) = {
                    let shown = self.shown();
                    (Arc::clone(&shown.page), shown.live.clone())
                };
                match live {
                    Some(live) if path.starts_with("/live") => live_answer(&live, request),
                    Some(live) if path == "/scene.json" && live.is_running() && !page.scene.live => {
                        scene(&following(&live))
                    }
                    _ if path == "/corrections" => self.saved(&page),
                    _ => get(&page, path),
                }
            }
            ("POST", "/corrections") => self.correct(request),
            ("POST", "/rerun") => self.start(request, started),
            ("POST", "/box") => self.save_box(request),
            _ => Answer::text(405, "only GET, POST /corrections, POST /rerun and POST /box"),
        }
    }

    /// Starts the run, unless one is active.
    fn start(&self, request: &Request, started: &mut Option<Arc<Live>>) -> Answer {
        match &self.rerun {
            None => return Answer::text(403, "this server starts no runs"),
            Some(Err(reason)) => return Answer::text(403, reason),
            Some(Ok(_)) if !is_json(request) => return Answer::text(415, "a run is requested with application/json"),
            Some(Ok(_)) => {}
        }
        *started = self.begin();
        match started {
            Some(_) => Answer::text(202, "started"),
            None => Answer::text(409, "a run is active"),
        }
    }

    /// The saved corrections that are not applied to the shown replica.
    fn saved(&self, page: &Page) -> Answer {
        let Some(folder) = &self.corrections else { return Answer::text(404, "this server accepts no corrections") };
        let all = match read_corrections(folder) {
            Ok(all) => all,
            Err(e) => return Answer::text(500, &e.to_string()),
        };
        let further = match (all, &page.corrected) {
            (None, _) => Some(Corrections::default()),
            (Some(all), None) => Some(all),
            (Some(all), Some((earlier, found))) => pending(&all, earlier, *found),
        };
        match further {
            Some(further) => match further.text() {
                Ok(text) => Answer::bytes(text.as_bytes(), "application/json"),
                Err(error) => Answer::text(500, &error.to_string()),
            },
            None => {
                Answer::text(409, "corrections.json lacks corrections that are already applied to the shown replica")
            }
        }
    }

    fn correct(&self, request: &Request) -> Answer {
        let Some(folder) = &self.corrections else { return Answer::text(403, "this server accepts no corrections") };
        if !is_json(request) {
            return Answer::text(415, "corrections are application/json");
        }
        if self.is_busy() {
            return Answer::text(409, "a run is active; corrections can be saved after it");
        }
        let _lock = match FolderLock::take(folder, "artgs view") {
            Ok(lock) => lock,
            Err(error @ LockError::File(_)) => return Answer::text(500, &error.to_string()),
            Err(error) => return Answer::text(409, &error.to_string()),
        };
        let earlier = self.shown().page.corrected.clone();
        let written = Corrections::parse(&request.body)
            .map(|c| earlier.map_or(c.clone(), |(earlier, found)| c.after(&earlier, found)))
            .and_then(|c| c.check().map(|()| c))
            .map_err(|reason| Answer::text(400, &reason))
            .and_then(|c| write_corrections(folder, &c).map_err(|e| Answer::text(500, &e.to_string())));
        written.map_or_else(|refused| refused, |()| Answer::text(200, "saved"))
    }

    fn save_box(&self, request: &Request) -> Answer {
        let Some(file) = &self.box_file else { return Answer::text(403, "this server saves no box") };
        if !is_json(request) {
            return Answer::text(415, "a box is application/json");
        }
        let bounds = match BoxBounds::parse(&request.body) {
            Ok(bounds) => bounds,
            Err(reason) => return Answer::text(400, &reason),
        };
        if let Err(error) = bounds.write(file) {
            return Answer::text(500, &error.to_string());
        }
        // A page that is loaded again begins with what was saved.
        let mut page = Page::clone(&self.shown().page);
        if let Some(edited) = &mut page.scene.object_box {
            (edited.lower, edited.upper, edited.saved) = (bounds.lower, bounds.upper, true);
        }
        self.show(page);
        Answer::text(200, "saved")
    }
}

/// Forms of other pages cannot send this type without a preflight request, which is refused.
fn is_json(request: &Request) -> bool {
    let kind = request.header("Content-Type").unwrap_or("").split(';').next().unwrap_or("").trim();
    kind.eq_ignore_ascii_case("application/json")
}

/// The page of a run after which the server shows another page.
fn following(live: &Live) -> Page {
    let mut page = Page::empty(live.name());
    page.place(live.placement());
    page.scene.live = true;
    page.scene.returns = true;
    page
}

fn get(page: &Page, path: &str) -> Answer {
    match path {
        "/" => Answer::bytes(HTML.as_bytes(), "text/html; charset=utf-8"),
        "/viewer.js" => Answer::bytes(SCRIPT.as_bytes(), "text/javascript; charset=utf-8"),
        "/viewer.css" => Answer::bytes(STYLE.as_bytes(), "text/css; charset=utf-8"),
        "/scene.json" => scene(page),
        _ => match path.strip_prefix("/files/").and_then(|name| Some((name, page.files.get(name)?))) {
            Some((name, source)) => file(name, source),
            None => Answer::text(404, "the file does not exist"),
        },
    }
}

fn scene(page: &Page) -> Answer {
    match page.scene_json() {
        Ok(text) => Answer::bytes(text.as_bytes(), "application/json"),
        Err(e) => Answer::text(500, &e.to_string()),
    }
}

fn live_answer(live: &Live, request: &Request) -> Answer {
    let splats = |tint| match live.spz(tint) {
        Some(bytes) => Answer::bytes(&bytes, "application/octet-stream"),
        None => Answer::text(404, "no Gaussians are available yet"),
    };
    match request.path() {
        "/live.json" => Answer::bytes(live.json(request.number("since")).as_bytes(), "application/json"),
        "/live/splats.spz" => splats(Tint::Photo),
        "/live/parts.spz" => splats(Tint::Parts),
        _ => Answer::text(404, "the file does not exist"),
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
