//! Work in a thread of its own, while the calling thread handles signals and callbacks.

use crate::errors::{CallError, exception};
use artgs::observer::{Event, Observer, until_stopped};
use pyo3::prelude::*;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::time::Duration;

/// Time between two looks for signals.
const PERIOD: Duration = Duration::from_millis(50);
/// Stack of the thread that works, as large as that of a program.
const STACK: usize = 8 << 20;

/// What the thread that works sends.
enum Message<T> {
    /// JSON of an event.
    Event(String),
    Done(Result<T, CallError>),
}

/// Sends events; nothing if nobody wants them.
struct Forward<T> {
    sender: Sender<Message<T>>,
    wanted: bool,
}

impl<T> Observer for Forward<T> {
    fn event(&mut self, event: Event) {
        if self.wanted
            && let Ok(text) = serde_json::to_string(&event)
        {
            // The receiver is gone after a second interruption.
            let _ = self.sender.send(Message::Event(text));
        }
    }
}

/// Does some work with the interpreter released, on `threads` threads or all. `callback` gets each event as JSON. Ctrl-C ends the
/// work at its next event, a second Ctrl-C returns at once.
pub(crate) fn work<T: Send + 'static>(
    py: Python<'_>,
    callback: Option<Bound<'_, PyAny>>,
    threads: Option<usize>,
    act: impl FnOnce(&mut dyn Observer) -> Result<T, CallError> + Send + 'static,
) -> PyResult<T> {
    let stop = Arc::new(AtomicBool::new(false));
    let (sender, receiver) = channel();
    let (flag, wanted) = (Arc::clone(&stop), callback.is_some());
    let begin = move || {
        let mut forward = Forward { sender: sender.clone(), wanted };
        let until = || until_stopped(&flag, &mut forward, act).unwrap_or_else(|| Err(CallError::interrupted()));
        // Threads of a pool that all calls share would be missing in a process that was forked.
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads.unwrap_or(0)).stack_size(STACK).build();
        let done = match pool {
            Ok(pool) => pool.install(|| artgs_cli::caught(until)).unwrap_or_else(|error| Err(error.into())),
            Err(error) => Err(CallError::failed(format!("cannot start threads: {error}"))),
        };
        let _ = sender.send(Message::Done(done));
    };
    std::thread::Builder::new().name("artgs".into()).stack_size(STACK).spawn(begin)?;
    wait(py, receiver, callback, &stop)?.map_err(|error| exception(py, &error))
}

/// Waits for the end of the work. The first exception of the callback or of a signal handler stops it.
fn wait<T: Send>(
    py: Python<'_>,
    mut receiver: Receiver<Message<T>>,
    callback: Option<Bound<'_, PyAny>>,
    stop: &AtomicBool,
) -> PyResult<Result<T, CallError>> {
    let mut raised = None;
    loop {
        let next = &mut receiver;
        let message = py.detach(move || next.recv_timeout(PERIOD));
        let handled = match (message, &callback) {
            (Ok(Message::Done(done)), _) => return raised.map_or(Ok(done), Err),
            (Ok(Message::Event(text)), Some(callback)) if raised.is_none() => callback.call1((text,)).map(drop),
            (Err(RecvTimeoutError::Disconnected), _) => {
                let ended = CallError::internal("the thread of the work has ended without a result");
                return raised.map_or(Ok(Err(ended)), Err);
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
