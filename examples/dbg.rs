use decoupler::{dataset::Seed, live::*, scene::*, sensor::SensorModel};
fn main() {
    let sensor = SensorModel::new("10x10_5x30".parse().unwrap());
    let scene = Scene {
        noise: Noise::relative(1e-3),
        loading: Loading::Indenter(Indenter::default()),
        ..Scene::default()
    };
    for a in std::env::args().skip(1) {
        let (f, seed) = a.split_once('/').unwrap();
        let mut s = Simulated::new(&sensor, &scene, Seed(seed.parse().unwrap()), 10.0).unwrap();
        s.set_fault(Some(f.parse().unwrap())).unwrap();
        let mut m = FaultMonitor::new(&sensor, &scene, s.rows()).unwrap();
        let mut fr = vec![0.0; s.readings()];
        for i in 0..20 {
            s.next_frame(&mut fr).unwrap();
            if let Some(e) = m.check(&fr) {
                println!("{a} {i} {e:?}");
            }
        }
    }
}
