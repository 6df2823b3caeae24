//! Commands in a thread of their own, while the calling thread handles signals and callbacks.

use crate::capture::Capture;
use crate::errors::exception;
use artgs::observer::{Event, Observer};
use artgs_cli::{CallError, Done};
use pyo3::prelude::*;
use std::ffi::OsString;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::time::Duration;

/// Time between two looks for signals.
const PERIOD: Duration = Duration::from_millis(50);
/// Stack of the thread that works, as large as that of a program.
const STACK: usize = 8 << 20;

/// What the thread that works sends.
enum Message {
    /// JSON of an event.
    Event(String),
    Done(Done),
}

/// Sends events; nothing if nobody wants them.
struct Forward {
    sender: Sender<Message>,
    wanted: bool,
}

impl Observer for Forward {
    fn event(&mut self, event: Event) {
        if self.wanted
            && let Ok(text) = serde_json::to_string(&event)
        {
            // The receiver is gone after a second interruption.
            let _ = self.sender.send(Message::Event(text));
        }
    }
}

/// Executes a command of `artgs` and returns its result as JSON. `words` follow the name of the program. `capture` replaces the folder
/// that they name; `callback` gets each event as JSON. Ctrl-C ends the command at its next event, a second Ctrl-C returns at once.
#[pyfunction]
#[pyo3(signature = (words, capture=None, callback=None, threads=None))]
pub(crate) fn call(
    py: Python<'_>,
    words: Vec<OsString>,
    capture: Option<Bound<'_, Capture>>,
    callback: Option<Bound<'_, PyAny>>,
    threads: Option<usize>,
) -> PyResult<String> {
    let given = capture.map(|capture| Arc::clone(&capture.get().0));
    let stop = Arc::new(AtomicBool::new(false));
    let (sender, receiver) = channel();
    let (flag, wanted) = (Arc::clone(&stop), callback.is_some());
    let work = move || {
        let mut forward = Forward { sender: sender.clone(), wanted };
        let given = given.map(|capture| (*capture).clone());
        // Threads of a pool that all calls share would be missing in a process that was forked.
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads.unwrap_or(0)).stack_size(STACK).build();
        let done = match pool {
            Ok(pool) => pool.install(|| artgs_cli::call(&words, given, &mut forward, &flag)),
            Err(error) => Err(CallError { message: format!("cannot start threads: {error}"), exit_code: 1 }),
        };
        let _ = sender.send(Message::Done(done));
    };
    std::thread::Builder::new().name("artgs".into()).stack_size(STACK).spawn(work)?;
    match wait(py, receiver, callback, &stop)? {
        Ok(value) => Ok(value.to_string()),
        Err(error) => Err(exception(py, &error)),
    }
}

/// Waits for the end of the work. The first exception of the callback or of a signal handler stops it.
fn wait(
    py: Python<'_>,
    mut receiver: Receiver<Message>,
    callback: Option<Bound<'_, PyAny>>,
    stop: &AtomicBool,
) -> PyResult<Done> {
    let mut raised = None;
    loop {
        let next = &mut receiver;
        let message = py.detach(move || next.recv_timeout(PERIOD));
        let handled = match (message, &callback) {
            (Ok(Message::Done(done)), _) => return raised.map_or(Ok(done), Err),
            (Ok(Message::Event(text)), Some(callback)) if raised.is_none() => callback.call1((text,)).map(drop),
            (Err(RecvTimeoutError::Disconnected), _) => {
                let message = "the thread of the command has ended without a result".into();
                return raised.map_or(Ok(Err(CallError { message, exit_code: 70 })), Err);
            }
            _ => Ok(()),
        };
        if let Err(error) = handled.and_then(|()| py.check_signals()) {
            stop.store(true, Ordering::Relaxed);
            if raised.is_some() {
                return Err(error);
            }
            raised = Some(error);
        }
    }
}

/// Executes a command line as the program does, on the streams of the process, and returns its exit code. `program` executes
/// `artgs` when it is started.
#[pyfunction]
pub(crate) fn command(py: Python<'_>, program: PathBuf, words: Vec<OsString>) -> u8 {
    py.detach(|| artgs_cli::command(&program, words))
}
