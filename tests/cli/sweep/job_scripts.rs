use std::{fs, process::Command};

use serde_json::json;

use super::driver::{fill, merged, names, six, spawn, success, wait_until};

/// Runs the scripts as the engines do, without the engines, which are tested in `.ci/engines`.
#[test]
fn job_scripts_train_every_trial_and_requeue_when_their_time_is_over() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path().join("it's a folder");
    fs::create_dir(&folder).unwrap();
    fs::write(folder.join("sweep.json"), six().to_string()).unwrap();
    fill("--out whole", &folder);
    for (engine, variable, ending) in [
        ("slurm", "SLURM_ARRAY_TASK_ID", "sh"),
        ("hyperqueue", "HQ_TASK_ID", "sh"),
    ] {
        let script = success(
            &format!("sweep --spec sweep.json --out {engine} --engine {engine} --jobs 2"),
            &folder,
        );
        assert!(script.contains("1-2"), "{script}");
        let path = folder.join(format!("{engine}.{ending}"));
        fs::write(&path, script).unwrap();
        for task in 1..=2 {
            let mut bash = Command::new("bash");
            let output = bash
                .arg(&path)
                .env(variable, task.to_string())
                .current_dir("/")
                .output()
                .unwrap();
            assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
            assert!(String::from_utf8_lossy(&output.stdout).starts_with("3 trials: 0 already done, 3 trained"));
        }
        assert_eq!(merged(engine, &folder), merged("whole", &folder), "{engine}");
    }
    let script = success("sweep --spec sweep.json --out many --engine parallel", &folder);
    assert!(
        script.starts_with("#!/bin/bash\n") && script.contains("seq 6 |"),
        "{script}"
    );

    // One minute before the time limit of the job.
    let long = json!({
        "train": {"max-fail": 1_000_000, "min-gradient": 0, "epochs": 1_000_000},
        "axes": {},
    });
    fs::write(folder.join("sweep.json"), long.to_string()).unwrap();
    let script = success("sweep --spec sweep.json --out long --engine slurm", &folder);
    fs::write(folder.join("long.sh"), script).unwrap();
    let scontrol = folder.join("scontrol");
    fs::write(&scontrol, "#!/bin/sh\necho \"$@\" > \"$0.called\"\n").unwrap();
    fs::set_permissions(&scontrol, std::os::unix::fs::PermissionsExt::from_mode(0o755)).unwrap();
    let mut bash = Command::new("bash");
    let path = format!("{}:{}", folder.display(), std::env::var("PATH").unwrap());
    bash.arg("long.sh").current_dir(&folder).env("PATH", path);
    bash.envs([("SLURM_ARRAY_TASK_ID", "1"), ("SLURM_ARRAY_JOB_ID", "77")]);
    let child = spawn(&mut bash);
    let long = folder.join("long");
    let is_begun = || names(&long).iter().any(|name| name.ends_with(".claim"));
    wait_until("the trial has started", || long.is_dir() && is_begun());
    let kill = format!("kill -USR1 {}", child.id());
    assert!(Command::new("sh").args(["-c", &kill]).status().unwrap().success());
    let output = child.wait_with_output().unwrap();
    assert_eq!(
        output.status.code(),
        Some(143),
        "{}",
        String::from_utf8_lossy(&output.stderr)
    );
    assert_eq!(
        fs::read_to_string(folder.join("scontrol.called")).unwrap(),
        "requeue 77_1\n"
    );
    assert!(names(&long).iter().any(|name| name.ends_with(".checkpoint")));
}
