//! Many independent tasks on the threads of this process: the one mechanism behind campaigns, certificates and benchmarks.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, PoisonError};

/// Processors that this process may use.
#[must_use]
pub fn processors() -> usize {
    std::thread::available_parallelism().map_or(1, usize::from)
}

/// Computes `compute(item)` of all items on at most `jobs` threads, and passes each result to `take`, one after the other, in the order
/// in which they are ready. Returns the number of results that `take` accepted. No new item is begun once `stop` returns true or an
/// error has occurred.
///
/// # Errors
/// The first error of `compute` or `take`.
pub fn each<T: Send, R, E: Send>(
    jobs: usize,
    items: impl IntoIterator<Item = T, IntoIter: Send>,
    stop: &(dyn Fn() -> bool + Sync),
    compute: &(impl Fn(T) -> Result<R, E> + Sync),
    take: impl FnMut(R) -> Result<(), E> + Send,
) -> Result<u64, E> {
    let items = Mutex::new(items.into_iter());
    let taken = Mutex::new((take, 0_u64, None));
    let has_failed = AtomicBool::new(false);
    let one = || {
        while !stop() && !has_failed.load(Ordering::Relaxed) {
            let next = items.lock().unwrap_or_else(PoisonError::into_inner).next();
            let Some(item) = next else { return };
            let result = compute(item);
            let mut taken = taken.lock().unwrap_or_else(PoisonError::into_inner);
            let (take, count, error) = &mut *taken;
            match result.and_then(take) {
                Ok(()) => *count += 1,
                Err(found) => {
                    has_failed.store(true, Ordering::Relaxed);
                    error.get_or_insert(found);
                }
            }
        }
    };
    std::thread::scope(|scope| {
        for _ in 1..jobs {
            scope.spawn(one);
        }
        one();
    });
    let (_, count, error) = taken.into_inner().unwrap_or_else(PoisonError::into_inner);
    error.map_or(Ok(count), Err)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_item_is_computed_once() {
        for jobs in [1, 2, 7] {
            let mut found = Vec::new();
            let count = each(
                jobs,
                0..100_u64,
                &|| false,
                &|item| Ok::<_, ()>(item),
                |item| {
                    found.push(item);
                    Ok(())
                },
            );
            found.sort_unstable();
            assert_eq!(count, Ok(100), "{jobs} jobs");
            assert_eq!(found, (0..100).collect::<Vec<_>>());
        }
    }

    #[test]
    fn first_error_ends_the_work() {
        let compute = |item: u64| if item == 3 { Err(item) } else { Ok(item) };
        let mut taken = 0;
        let end = each(1, 0.., &|| false, &compute, |_| {
            taken += 1;
            Ok(())
        });
        assert_eq!((end, taken), (Err(3), 3));
    }

    #[test]
    fn nothing_is_begun_after_a_stop() {
        let begun = Mutex::new(0);
        let compute = |_: u64| {
            *begun.lock().unwrap() += 1;
            Ok::<_, ()>(())
        };
        let stop = || *begun.lock().unwrap() >= 5;
        let count = each(1, 0.., &stop, &compute, |()| Ok(()));
        assert_eq!(count, Ok(5));
    }
}
