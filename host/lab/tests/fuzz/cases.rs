//! Runs a property over generated cases: so many in the tests, for so many minutes in the long run.

use proptest::strategy::Strategy;
use proptest::test_runner::{Config, RngAlgorithm, TestCaseError, TestError, TestRng, TestRunner};
use std::fmt::Debug;
use std::time::{Duration, Instant};

/// Minutes per target of the long run.
const MINUTES: &str = "PRBVH_FUZZ_MINUTES";
/// First seed of the long run.
const SEED: &str = "PRBVH_FUZZ_SEED";

/// Which cases, and how many.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Budget {
    pub(crate) seed: u64,
    pub(crate) cases: u32,
}

impl Budget {
    /// The same cases in every run of the tests: a change that passes today passes tomorrow.
    pub(crate) fn of_tests(cases: u32) -> Self {
        Self { seed: 0, cases }
    }
}

fn number(variable: &str) -> Option<f64> {
    let text = std::env::var(variable).ok()?;
    Some(text.parse().unwrap_or_else(|_| panic!("{variable} is {text}, but must be a number")))
}

/// Runs the cases of the budget; in the long run batch after batch of other seeds.
pub(crate) fn run<S: Strategy>(name: &str, budget: Budget, strategy: S, check: impl Fn(&S::Value) -> Result<(), String>)
where
    S::Value: Clone + Debug,
{
    let start = Instant::now();
    let limit = number(MINUTES).map(|minutes| Duration::from_secs_f64(minutes * 60.0));
    let mut seed = if limit.is_some() { number(SEED).unwrap_or(1.0) as u64 } else { budget.seed };
    loop {
        if let Err((case, text)) = search(Budget { seed, ..budget }, &strategy, &check) {
            panic!("{name}, seed {seed}: {text}\nsmallest case: {case:?}");
        }
        if limit.is_none_or(|limit| start.elapsed() >= limit) {
            break;
        }
        seed += 1;
    }
    println!("{name}: {} cases of each seed up to {seed}", budget.cases);
}

/// The smallest case that was found to fail, and how.
pub(crate) fn search<S: Strategy>(
    budget: Budget,
    strategy: S,
    check: impl Fn(&S::Value) -> Result<(), String>,
) -> Result<(), (S::Value, String)>
where
    S::Value: Clone + Debug,
{
    let config = Config { cases: budget.cases, failure_persistence: None, max_shrink_iters: 2000, ..Config::default() };
    let mut seed = [0; 32];
    seed[..8].copy_from_slice(&budget.seed.to_le_bytes());
    let mut runner = TestRunner::new_with_rng(config, TestRng::from_seed(RngAlgorithm::ChaCha, &seed));
    match runner.run(&strategy, |case| check(&case).map_err(TestCaseError::fail)) {
        Ok(()) => Ok(()),
        // What the smallest case does, not what the first one did.
        Err(TestError::Fail(_, case)) => {
            Err((case.clone(), check(&case).err().unwrap_or_else(|| "fails at times".to_owned())))
        }
        Err(TestError::Abort(reason)) => panic!("{reason}"),
    }
}
