//! The log on stderr, and the progress bar that it must not tear.

use super::colour::Colour;
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use std::io::{self, Write};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;
use tracing_subscriber::filter::LevelFilter;

/// The log, and the running progress bar if there is one.
#[derive(Clone, Debug)]
pub(super) struct Log {
    bar: Arc<Mutex<Option<ProgressBar>>>,
    colour: Colour,
}

/// Starts the log: information by default, each `quiet` less, each `verbose` more.
pub(super) fn start(quiet: u8, verbose: u8, colour: Colour) -> Log {
    let log = Log { bar: Arc::default(), colour };
    let level = match i16::from(verbose) - i16::from(quiet) {
        ..=-2 => LevelFilter::ERROR,
        -1 => LevelFilter::WARN,
        0 => LevelFilter::INFO,
        1 => LevelFilter::DEBUG,
        _ => LevelFilter::TRACE,
    };
    let writer = log.clone();
    tracing_subscriber::fmt()
        .with_max_level(level)
        .without_time()
        .with_target(false)
        // It would report them to stderr, which is what fails where the reader went away, and panic.
        .log_internal_errors(false)
        .with_ansi(colour.on_stderr)
        .with_writer(move || writer.clone())
        .init();
    log
}

impl Log {
    /// A bar over at most `iterations` iterations; invisible where stderr is no terminal that bars can move on.
    pub(super) fn bar(&self, iterations: u32) -> ProgressBar {
        self.shown(ProgressBar::new(u64::from(iterations)), "{spinner} iteration {pos}, {elapsed}, {wide_msg}")
    }

    /// A bar over steps of unknown length.
    pub(super) fn steps(&self) -> ProgressBar {
        let bar = self.shown(ProgressBar::new(0), "{spinner} {pos} of {len}, {elapsed}, {wide_msg}");
        bar.enable_steady_tick(Duration::from_millis(200));
        bar
    }

    fn shown(&self, bar: ProgressBar, template: &str) -> ProgressBar {
        if let Ok(style) = ProgressStyle::with_template(template) {
            bar.set_style(style);
        }
        if !self.colour.is_animated {
            bar.set_draw_target(ProgressDrawTarget::hidden());
        }
        *self.bar.lock().unwrap_or_else(PoisonError::into_inner) = Some(bar.clone());
        bar
    }

    /// Takes the bar away.
    pub(super) fn end_bar(&self) {
        if let Some(bar) = self.bar.lock().unwrap_or_else(PoisonError::into_inner).take() {
            bar.finish_and_clear();
        }
    }
}

impl Write for Log {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let bar = self.bar.lock().unwrap_or_else(PoisonError::into_inner);
        let write = || io::stderr().write_all(bytes).map(|()| bytes.len());
        match &*bar {
            Some(bar) => bar.suspend(write),
            None => write(),
        }
    }

    fn flush(&mut self) -> io::Result<()> {
        io::stderr().flush()
    }
}
