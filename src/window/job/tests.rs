use std::{
    sync::{
        Arc, Mutex,
        mpsc::{Receiver, Sender, channel},
    },
    thread,
    time::Duration,
};

use super::{Background, JobError, Jobs, Report};

/// Timeout, far longer than any test takes.
const LONG: Duration = Duration::from_secs(600);

#[derive(Debug, PartialEq)]
enum Event {
    Said(&'static str),
    /// Latest number, and the sum of all numbers.
    Counted(u64, u64),
    Ended(Result<(), JobError>),
}

fn job() -> Background<Event> {
    Background::new("test", &Jobs::new(Arc::new(|| ())))
}

/// Waits for the end and returns all events.
fn all_of(job: &mut Background<Event>) -> Vec<Event> {
    job.wait(LONG);
    let events = std::iter::from_fn(|| job.next_event()).collect();
    assert!(!job.is_under_way());
    events
}

/// Returns work that sends an event and signals that it has begun, waits for the gate to open, and sends another event.
fn gated(before: &'static str, after: &'static str) -> (impl FnOnce(&Report<Event>) + Send, Receiver<()>, Sender<()>) {
    let (begun, has_begun) = channel();
    let (gate, opened) = channel::<()>();
    let work = move |report: &Report<Event>| {
        report.send(Event::Said(before));
        begun.send(()).unwrap();
        let _ = opened.recv();
        report.send(Event::Said(after));
    };
    (work, has_begun, gate)
}

fn spin_until_cancelled(report: &Report<Event>) {
    while !report.is_cancelled() {
        thread::yield_now();
    }
}

#[test]
fn events_come_in_order_and_the_result_last() {
    let mut job = job();
    assert!(job.next_event().is_none() && !job.is_under_way());
    job.start(
        |report| ["one", "two", "three"].map(|word| report.send(Event::Said(word))),
        |ended| Event::Ended(ended.map(|_| ())),
    );
    assert!(job.is_under_way(), "the last event has not been received");
    let words = ["one", "two", "three"].map(Event::Said).into_iter();
    assert_eq!(
        all_of(&mut job),
        words.chain([Event::Ended(Ok(()))]).collect::<Vec<_>>()
    );
}

#[test]
fn events_of_older_work_are_discarded_even_if_sent_before_the_newer_began() {
    let mut job = job();
    let (work, has_begun, gate) = gated("old, before", "old, after");
    job.start(work, Event::Ended);
    has_begun.recv().unwrap();
    job.start(|report| report.send(Event::Said("new")), Event::Ended);
    gate.send(()).unwrap();
    assert_eq!(all_of(&mut job), [Event::Said("new"), Event::Ended(Ok(()))]);
}

#[test]
fn newer_work_starts_after_all_older_work_has_ended() {
    let log = Arc::new(Mutex::new(Vec::new()));
    let mut job = job();
    for number in 0..4 {
        let log = Arc::clone(&log);
        let work = move |report: &Report<Event>| {
            log.lock().unwrap().push((number, "begins"));
            if number < 3 {
                spin_until_cancelled(report);
            }
            log.lock().unwrap().push((number, "ends"));
        };
        job.start(work, Event::Ended);
    }
    assert_eq!(all_of(&mut job), [Event::Ended(Ok(()))]);
    let expected: Vec<_> = (0..4)
        .flat_map(|number| [(number, "begins"), (number, "ends")])
        .collect();
    assert_eq!(*log.lock().unwrap(), expected);
}

#[test]
fn unreceived_progress_is_replaced_and_its_data_is_kept() {
    const STEPS: u64 = 10_000;
    let add = |older: Event, newer: &mut Event| match (older, newer) {
        (Event::Counted(_, before), Event::Counted(_, sum)) => *sum += before,
        other => panic!("{other:?}"),
    };
    let mut job = job();
    job.start(
        move |report| {
            for step in 1..=STEPS {
                report.progress(Event::Counted(step, step), add);
            }
            report.send(Event::Said("half"));
            for step in 1..=STEPS {
                report.progress(Event::Counted(step, step), add);
            }
        },
        Event::Ended,
    );
    let sum = STEPS * (STEPS + 1) / 2;
    let expected = [
        Event::Counted(STEPS, sum),
        Event::Said("half"),
        Event::Counted(STEPS, sum),
        Event::Ended(Ok(())),
    ];
    assert_eq!(
        all_of(&mut job),
        expected,
        "an event keeps its place between progress reports"
    );
}

#[test]
fn received_progress_is_not_added_again() {
    let (woke, wakes) = channel();
    let (go_on, may_go_on) = channel();
    let mut job = Background::new("test", &Jobs::new(Arc::new(move || woke.send(()).unwrap_or(()))));
    job.start(
        move |report| {
            for step in 1..=3 {
                report.progress(Event::Counted(step, step), |_, newer| *newer = Event::Said("replaced"));
                may_go_on.recv().unwrap();
            }
        },
        Event::Ended,
    );
    for step in 1..=3 {
        wakes.recv_timeout(LONG).unwrap();
        assert_eq!(job.next_event(), Some(Event::Counted(step, step)));
        go_on.send(()).unwrap();
    }
    assert_eq!(all_of(&mut job), [Event::Ended(Ok(()))]);
}

#[test]
fn a_panic_is_reported_with_its_message_and_the_window_is_woken() {
    let expected = |panic: &str| {
        Event::Ended(Err(JobError::Panicked {
            name: "test",
            panic: panic.to_owned(),
        }))
    };
    let (woke, wakes) = channel();
    let mut job = Background::new("test", &Jobs::new(Arc::new(move || woke.send(()).unwrap_or(()))));
    job.start(|_| panic!("a plain reason"), Event::Ended);
    wakes.recv_timeout(LONG).unwrap();
    assert_eq!(all_of(&mut job), [expected("a plain reason")]);
    let number = 7;
    job.start(
        move |report| {
            report.send(Event::Said("before"));
            panic!("a reason with the number {number}")
        },
        Event::Ended,
    );
    let events = all_of(&mut job);
    assert_eq!(events, [Event::Said("before"), expected("a reason with the number 7")]);
    job.start(|_| std::panic::panic_any(7_u8), Event::Ended);
    assert_eq!(all_of(&mut job), [expected("unknown cause")]);
    // The job can be used again.
    job.start(|_| (), Event::Ended);
    assert_eq!(all_of(&mut job), [Event::Ended(Ok(()))]);
}

#[test]
fn events_of_cancelled_work_are_received_unless_it_is_abandoned() {
    let work = |report: &Report<Event>| {
        spin_until_cancelled(report);
        report.send(Event::Said("cancelled"));
    };
    let mut job = job();
    job.start(work, Event::Ended);
    job.cancel();
    assert_eq!(all_of(&mut job), [Event::Said("cancelled"), Event::Ended(Ok(()))]);
    job.start(work, Event::Ended);
    job.abandon();
    assert!(!job.is_under_way());
    assert_eq!(all_of(&mut job), []);
}

#[test]
fn dropping_a_job_cancels_and_joins_its_thread() {
    let held = Arc::new(());
    let mut job = job();
    let in_thread = Arc::clone(&held);
    job.start(
        move |report| {
            spin_until_cancelled(report);
            drop(in_thread);
        },
        Event::Ended,
    );
    drop(job);
    assert_eq!(Arc::strong_count(&held), 1);
}

#[test]
fn dropping_does_not_wait_forever() {
    let (work, has_begun, gate) = gated("before", "after");
    let mut job = job();
    job.start(work, Event::Ended);
    has_begun.recv().unwrap();
    drop(job);
    gate.send(()).expect("the work is still waiting");
}

#[test]
fn one_list_knows_which_jobs_compute_and_cancels_them_all() {
    let jobs = Jobs::new(Arc::new(|| ()));
    let [mut one, mut other] = ["one", "other"].map(|name| Background::new(name, &jobs));
    assert_eq!(one.distorted_by(), None);
    let (work, has_begun, gate) = gated("before", "after");
    one.start(work, Event::Ended);
    has_begun.recv_timeout(LONG).unwrap();
    assert_eq!((one.distorted_by(), other.distorted_by()), (None, Some("one")));
    gate.send(()).unwrap();
    one.wait(LONG);
    assert_eq!(other.distorted_by(), None, "it has ended");

    let (begun, has_begun) = channel();
    let (gate, opened) = channel::<()>();
    let waits = move |report: &Report<Event>| {
        report.waiting(|| {
            begun.send(()).unwrap();
            opened.recv().unwrap();
        });
        begun.send(()).unwrap();
        spin_until_cancelled(report);
    };
    one.start(waits, Event::Ended);
    has_begun.recv_timeout(LONG).unwrap();
    assert_eq!(other.distorted_by(), None, "it waits");
    gate.send(()).unwrap();
    has_begun.recv_timeout(LONG).unwrap();
    other.start(spin_until_cancelled, Event::Ended);
    assert_eq!((one.distorted_by(), other.distorted_by()), (Some("other"), Some("one")));
    jobs.cancel_all();
    for job in [&mut one, &mut other] {
        assert_eq!(all_of(job), [Event::Ended(Ok(()))]);
    }
    assert_eq!((one.distorted_by(), other.distorted_by()), (None, None));
}
