//! Where the time of a run goes: the spans that libraries open, as a tree of phases.
//!
//! The libraries open a span for each phase ([`tracing`]), which costs nothing while nobody listens.
//! A [`Recorder`] listens to the spans of its own thread. Spans of one name within the same phase
//! are one phase. Parts of a phase that run beside one another are recorded by it as wall seconds, in
//! fields with the names of the parts.

use crate::progress;
use serde::Serialize;
use std::fmt::Debug;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};
use tracing::field::{Field, Visit};
use tracing::span::{Id, Record};
use tracing::subscriber::DefaultGuard;
use tracing::{Subscriber, subscriber};
use tracing_subscriber::Layer;
use tracing_subscriber::layer::{Context, SubscriberExt};
use tracing_subscriber::registry::LookupSpan;

/// A phase and those within it.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub(crate) struct Phase {
    pub(crate) name: &'static str,
    /// How often it was entered.
    pub(crate) count: u64,
    /// Wall seconds.
    pub(crate) wall: f64,
    /// Processor seconds of all threads of the process; `None` where the system does not count them,
    /// and for a part that runs beside others.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) processor: Option<f64>,
    /// In the order in which they were first entered. The rest of the time is the phase's own.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub(crate) phases: Vec<Phase>,
}

/// Records phases from its creation until it is dropped.
pub(crate) struct Recorder {
    tree: Arc<Mutex<Tree>>,
    _listening: DefaultGuard,
}

impl Recorder {
    /// Listens to the spans of this thread.
    pub(crate) fn listen() -> Self {
        let tree = Arc::new(Mutex::new(Tree::new("total")));
        let listener = Listener(Arc::clone(&tree));
        let both = tracing_subscriber::registry().with(progress::log()).with(listener);
        Self { tree, _listening: subscriber::set_default(both) }
    }

    /// The phases so far; those that have not ended count up to their last end.
    pub(crate) fn phases(&self) -> Phase {
        let mut tree = lock(&self.tree);
        tree.nodes[0].spent = tree.start.elapsed();
        tree.phase(0)
    }
}

/// Passes spans to the tree.
struct Listener(Arc<Mutex<Tree>>);

impl<S: Subscriber + for<'s> LookupSpan<'s>> Layer<S> for Listener {
    fn on_enter(&self, id: &Id, context: Context<'_, S>) {
        if let Some(span) = context.metadata(id) {
            lock(&self.0).enter(span.name());
        }
    }

    fn on_record(&self, _: &Id, values: &Record<'_>, _: Context<'_, S>) {
        values.record(&mut Parts(lock(&self.0)));
    }

    fn on_exit(&self, _: &Id, _: Context<'_, S>) {
        lock(&self.0).exit();
    }
}

/// Adds recorded seconds to the phase that was entered last.
struct Parts<'a>(MutexGuard<'a, Tree>);

impl Visit for Parts<'_> {
    fn record_f64(&mut self, field: &Field, seconds: f64) {
        self.0.part(field.name(), Duration::try_from_secs_f64(seconds).unwrap_or_default());
    }

    fn record_debug(&mut self, _: &Field, _: &dyn Debug) {}
}

/// A panic leaves times behind that are as good as before.
fn lock(tree: &Mutex<Tree>) -> MutexGuard<'_, Tree> {
    tree.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Phases while they are recorded.
struct Tree {
    /// The first one is the whole.
    nodes: Vec<Node>,
    start: Moment,
    /// The phases entered and not left yet, with when they were entered.
    open: Vec<(usize, Moment)>,
}

struct Node {
    name: &'static str,
    count: u64,
    spent: Spent,
    /// Whether it runs beside others.
    is_part: bool,
    within: Vec<usize>,
}

impl Node {
    fn new(name: &'static str) -> Self {
        Self { name, count: 0, spent: Spent::default(), is_part: false, within: Vec::new() }
    }
}

impl Tree {
    fn new(name: &'static str) -> Self {
        let whole = Node { count: 1, ..Node::new(name) };
        Self { nodes: vec![whole], start: Moment::now(), open: Vec::new() }
    }

    fn enter(&mut self, name: &'static str) {
        let node = self.node(name);
        self.nodes[node].count += 1;
        self.open.push((node, Moment::now()));
    }

    fn part(&mut self, name: &'static str, wall: Duration) {
        let node = self.node(name);
        let part = &mut self.nodes[node];
        part.is_part = true;
        part.count += 1;
        part.spent.wall += wall;
    }

    /// The phase of this name within the one entered last.
    fn node(&mut self, name: &'static str) -> usize {
        let around = self.open.last().map_or(0, |open| open.0);
        let found = self.nodes[around].within.iter().copied().find(|k| self.nodes[*k].name == name);
        found.unwrap_or_else(|| {
            self.nodes.push(Node::new(name));
            let node = self.nodes.len() - 1;
            self.nodes[around].within.push(node);
            node
        })
    }

    fn exit(&mut self) {
        if let Some((node, entered)) = self.open.pop() {
            let Spent { wall, processor } = entered.elapsed();
            let spent = &mut self.nodes[node].spent;
            spent.wall += wall;
            spent.processor += processor;
        }
    }

    fn phase(&self, node: usize) -> Phase {
        let Node { name, count, spent, is_part, within } = &self.nodes[node];
        let counts = self.start.processor.is_some() && !is_part;
        Phase {
            name,
            count: *count,
            wall: spent.wall.as_secs_f64(),
            processor: counts.then_some(spent.processor.as_secs_f64()),
            phases: within.iter().map(|k| self.phase(*k)).collect(),
        }
    }
}

/// Times since a moment.
#[derive(Default)]
struct Spent {
    wall: Duration,
    processor: Duration,
}

/// A moment on both clocks.
struct Moment {
    wall: Instant,
    processor: Option<Duration>,
}

impl Moment {
    fn now() -> Self {
        Self { wall: Instant::now(), processor: processor_time() }
    }

    fn elapsed(&self) -> Spent {
        let since = |now: Duration, then| now.saturating_sub(then);
        let processor = processor_time().zip(self.processor);
        Spent {
            wall: self.wall.elapsed(),
            processor: processor.map_or(Duration::ZERO, |(now, then)| since(now, then)),
        }
    }
}

/// Processor time of all threads of this process so far.
#[cfg(unix)]
fn processor_time() -> Option<Duration> {
    use rustix::time::{ClockId, clock_gettime};
    clock_gettime(ClockId::ProcessCPUTime).try_into().ok()
}

#[cfg(not(unix))]
fn processor_time() -> Option<Duration> {
    None
}

#[cfg(test)]
mod tests {
    use super::*;
    use tracing::field::Empty;
    use tracing::trace_span;

    #[test]
    fn spans_of_one_name_in_one_phase_are_one_phase() {
        let recorder = Recorder::listen();
        for _ in 0..3 {
            let _outer = trace_span!("outer").entered();
            trace_span!("first").in_scope(|| std::thread::sleep(Duration::from_millis(2)));
            let _second = trace_span!("second").entered();
            trace_span!("first").in_scope(|| ());
        }
        // Spans of other threads overlap, and are no phases.
        std::thread::scope(|s| {
            s.spawn(|| trace_span!("elsewhere").in_scope(|| ())).join().unwrap()
        });
        let total = recorder.phases();
        let shape =
            |p: &Phase| (p.name, p.count, p.phases.iter().map(|p| p.name).collect::<Vec<_>>());
        assert_eq!(shape(&total), ("total", 1, vec!["outer"]));
        let outer = &total.phases[0];
        assert_eq!(shape(outer), ("outer", 3, vec!["first", "second"]));
        assert_eq!(shape(&outer.phases[1]), ("second", 3, vec!["first"]));
        assert!(outer.phases[0].wall >= 6e-3 && outer.phases[1].phases[0].wall < outer.wall - 5e-3);
        assert!(total.wall >= outer.wall);
        drop(recorder);
        assert!(!tracing::enabled!(tracing::Level::ERROR), "nobody listens");
    }

    #[test]
    fn parts_that_run_beside_one_another_have_wall_seconds_alone() {
        let recorder = Recorder::listen();
        for _ in 0..2 {
            let both = trace_span!("both", "first part" = Empty, other = Empty).entered();
            both.record("first part", 0.25).record("other", 0.5);
        }
        let both = &recorder.phases().phases[0];
        let part = |p: &Phase| (p.name, p.count, p.wall, p.processor);
        let parts: Vec<_> = both.phases.iter().map(part).collect();
        assert_eq!(parts, [("first part", 2, 0.5, None), ("other", 2, 1.0, None)]);
        assert!(both.wall < 0.5);
    }

    #[cfg(unix)]
    #[test]
    fn processor_time_is_that_of_all_work() {
        let recorder = Recorder::listen();
        trace_span!("work").in_scope(|| {
            let start = processor_time().unwrap();
            while processor_time().unwrap() < start + Duration::from_millis(10) {}
        });
        let total = recorder.phases();
        let [work, whole] = [&total.phases[0], &total].map(|phase| phase.processor.unwrap());
        assert!(work >= 0.01 && whole >= work, "{work} {whole}");
    }
}
