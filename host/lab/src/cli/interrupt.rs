//! SIGINT, which is Ctrl-C, and SIGTERM. Where nothing is to be kept, either ends the program at once. While something is held, the first asks for an end
//! and the next one ends the program.

use prbvh::stop::Stop;
use signal_hook::consts::{SIGINT, SIGTERM};
use signal_hook::flag;
use std::process::ExitCode;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

/// The signals, and the exit codes of programs that they ended.
const SIGNALS: [(i32, u8); 2] = [(SIGINT, 130), (SIGTERM, 143)];

/// Whether a signal came. The handlers themselves end the program, so that no signal waits for a read that waits for a pipe.
#[derive(Debug)]
pub(super) struct Interrupt {
    at_once: Arc<AtomicBool>,
    asked: Arc<AtomicBool>,
    /// 0 before a signal.
    code: Arc<AtomicUsize>,
}

impl Interrupt {
    /// Listens from now on.
    pub(super) fn listen() -> Self {
        let interrupt = Self { at_once: Arc::new(true.into()), asked: Arc::default(), code: Arc::default() };
        for (signal, code) in SIGNALS {
            let Self { at_once, asked, code: came } = &interrupt;
            // In this order: a signal must not find what it sets itself.
            let listening = flag::register_conditional_shutdown(signal, code.into(), Arc::clone(at_once))
                .and_then(|_| flag::register_usize(signal, Arc::clone(came), code.into()))
                .and_then(|_| flag::register(signal, Arc::clone(asked)))
                .and_then(|_| flag::register(signal, Arc::clone(at_once)));
            if let Err(error) = listening {
                tracing::warn!("signal {signal} will end the program with nothing kept: {error}");
            }
        }
        interrupt
    }

    /// From now on there is something to keep.
    pub(super) fn hold(&self) -> Held<'_> {
        self.at_once.store(false, Ordering::SeqCst);
        // One that came before has been the first.
        if self.pressed() {
            self.at_once.store(true, Ordering::SeqCst);
        }
        Held(self)
    }

    pub(super) fn pressed(&self) -> bool {
        self.asked.load(Ordering::SeqCst)
    }

    /// What a run is to look at.
    pub(super) fn stop(&self) -> Stop {
        Arc::clone(&self.asked).into()
    }

    /// The exit code if a signal came.
    pub(super) fn exit_code(&self) -> Option<ExitCode> {
        match self.code.load(Ordering::SeqCst) {
            0 => None,
            code => u8::try_from(code).ok().map(ExitCode::from),
        }
    }
}

/// Something that a first signal must not take away, as long as this lives.
#[derive(Debug)]
pub(super) struct Held<'a>(&'a Interrupt);

impl Drop for Held<'_> {
    fn drop(&mut self) {
        self.0.at_once.store(true, Ordering::SeqCst);
    }
}
