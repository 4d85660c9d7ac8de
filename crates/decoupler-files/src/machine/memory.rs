use std::{env, fs, sync::OnceLock};

use decoupler_core::machine::MemoryBudget;

static MEMORY: OnceLock<MemoryBudget> = OnceLock::new();

/// Limits the memory that the program may use, instead of [`MemoryBudget::VARIABLE`]. Without effect after the first call of
/// [`memory_budget`].
pub fn limit_memory(gigabytes: f64) {
    MEMORY.get_or_init(|| from_texts(Some(&gigabytes.to_string()), None, None));
}

/// Returns the memory available to trainings: that of the machine, or the limit of its container, or the limit given by the
/// user; [`MemoryBudget::ASSUMED_BYTES`] if none is known. It is read on the first call.
///
/// Only Linux reports its memory in a file. Other systems would need `unsafe` calls, or a crate of thousands of lines
/// for one number; use the variable there, or to use less than the memory of the machine.
pub fn memory_budget() -> MemoryBudget {
    *MEMORY.get_or_init(|| {
        let given = env::var(MemoryBudget::VARIABLE).ok();
        let meminfo = fs::read_to_string("/proc/meminfo").ok();
        let limit = fs::read_to_string("/sys/fs/cgroup/memory.max").ok();
        from_texts(given.as_deref(), meminfo.as_deref(), limit.as_deref())
    })
}

/// Evaluates the texts of the variable, of `/proc/meminfo` and of the container's limit. A variable that is not a
/// number above 0 is ignored; the error message of a run that needs too much memory names the variable again.
fn from_texts(given: Option<&str>, meminfo: Option<&str>, limit: Option<&str>) -> MemoryBudget {
    let gigabytes = given.and_then(|text| text.trim().parse().ok());
    if let Some(gigabytes) = gigabytes.filter(|gigabytes: &f64| *gigabytes > 0.0) {
        // Saturates, also at infinity.
        return MemoryBudget::User((gigabytes * 1e9) as u64);
    }
    let limit = limit.and_then(|text| text.trim().parse().ok());
    let total = meminfo.and_then(|text| bytes_of(text, "MemTotal:"));
    let of_system = [total, limit].into_iter().flatten().min().map(MemoryBudget::System);
    of_system.unwrap_or(MemoryBudget::Assumed(MemoryBudget::ASSUMED_BYTES))
}

/// Returns the number of bytes on the line of a file in `/proc` that begins with `key`.
pub(super) fn bytes_of(text: &str, key: &str) -> Option<u64> {
    let line = text.lines().find_map(|line| line.strip_prefix(key))?;
    let kibibytes: u64 = line.trim().strip_suffix("kB")?.trim().parse().ok()?;
    Some(kibibytes * 1024)
}

#[cfg(test)]
mod tests {
    use super::*;

    const MEMINFO: &str = "MemTotal:       24683956 kB\nMemFree:        24097000 kB\n";

    #[test]
    fn the_memory_is_the_smaller_of_machine_and_container() {
        let memory = |meminfo, limit| from_texts(None, meminfo, limit);
        let known = |bytes| MemoryBudget::System(bytes);
        assert_eq!(memory(Some(MEMINFO), None), known(24_683_956 * 1024));
        assert_eq!(memory(Some(MEMINFO), Some("max\n")), known(24_683_956 * 1024));
        assert_eq!(memory(Some(MEMINFO), Some("1000000\n")), known(1_000_000));
        assert_eq!(memory(Some(MEMINFO), None).to_string(), "the machine has 25.3 GB");
    }

    #[test]
    fn without_a_reported_size_the_message_names_the_assumption_and_the_variable() {
        let memory = from_texts(None, Some("MemFree: 5 kB\n"), None);
        assert_eq!(memory, MemoryBudget::Assumed(MemoryBudget::ASSUMED_BYTES));
        let text = memory.to_string();
        assert!(
            text.contains("8.0 GB are assumed") && text.contains("DECOUPLER_MEMORY_GB"),
            "{text}"
        );
    }

    #[test]
    fn the_variable_overrides_the_memory() {
        let memory = |given| from_texts(Some(given), Some(MEMINFO), Some("1000000"));
        assert_eq!(memory("64").bytes(), 64_000_000_000);
        assert_eq!(
            memory(" 0.5\n").to_string(),
            "the memory limit (DECOUPLER_MEMORY_GB) is 0.5 GB"
        );
        assert_eq!(memory("inf").bytes(), u64::MAX);
        for refused in ["", "much", "0", "-3", "NaN"] {
            assert_eq!(memory(refused).bytes(), 1_000_000, "{refused}");
        }
    }
}
