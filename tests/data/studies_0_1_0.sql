BEGIN TRANSACTION;
CREATE TABLE domino_store (
	schema INTEGER NOT NULL
);
INSERT INTO "domino_store" VALUES(1);
CREATE TABLE results (
	number INTEGER NOT NULL, 
	study INTEGER NOT NULL, 
	"key" TEXT NOT NULL, 
	scene TEXT NOT NULL, 
	scene_name TEXT NOT NULL, 
	method TEXT NOT NULL, 
	seed BIGINT NOT NULL, 
	labels TEXT NOT NULL, 
	score DOUBLE NOT NULL, 
	uniform_score DOUBLE NOT NULL, 
	gain DOUBLE, 
	outcome TEXT NOT NULL, 
	mean_speed DOUBLE NOT NULL, 
	spacing TEXT NOT NULL, 
	thickness TEXT NOT NULL, 
	height TEXT NOT NULL, 
	evaluations BIGINT NOT NULL, 
	falls BIGINT NOT NULL, 
	seconds DOUBLE NOT NULL, 
	trace TEXT NOT NULL, 
	versions TEXT NOT NULL, 
	PRIMARY KEY (number), 
	UNIQUE (study, "key"), 
	FOREIGN KEY(study) REFERENCES studies (number), 
	FOREIGN KEY(scene) REFERENCES scenes (digest)
);
INSERT INTO "results" VALUES(1,1,'9f3c8d392009576c31b5591706a7f2df','47143a4cd3e8b948fcdf52dde3bdb2ef','five','random',0,'{"physics.push":8.0}',5.74480191635617476464e-01,5.94168449311777480126e-01,-3.31358181319874045556e-02,'PROPAGATED',5.74480191635617476464e-01,'[0.025568111176584356,0.03981366719894232,0.038059859647635086,0.01948171529374565]','[0.0075,0.0075,0.0075,0.0075,0.0075]','[0.048,0.048,0.048,0.048,0.048]',20,100,0.0726047699999981,'[[20,100,0.07232212799999616,0.5744801916496295],[20,100,0.0726047699999981,0.5744801916496295]]','{"python":"3.11.7","domino-chains":"0.1.0","numpy":"2.4.6","scipy":"1.17.1","numba":"0.68.1","cma":"4.5.0"}');
INSERT INTO "results" VALUES(2,1,'c7d3aab01575f7ab98db0cf19a98c402','b6fefc291f3a403f981bdd368f3d13ec','five','random',0,'{"physics.push":9.0}',0.598987614595916,6.16281862582495731928e-01,-2.80622374867712798263e-02,'PROPAGATED',0.598987614595916,'[0.025568111176584356,0.03981366719894232,0.038059859647635086,0.01948171529374565]','[0.0075,0.0075,0.0075,0.0075,0.0075]','[0.048,0.048,0.048,0.048,0.048]',20,100,2.16607469999416935024e-02,'[[20,100,0.02152478399989377,0.5989876146108218],[20,100,0.021660746999941694,0.5989876146108218]]','{"python":"3.11.7","domino-chains":"0.1.0","numpy":"2.4.6","scipy":"1.17.1","numba":"0.68.1","cma":"4.5.0"}');
INSERT INTO "results" VALUES(3,2,'c19c961b0dfaffafa8830eff48bfed97','47143a4cd3e8b948fcdf52dde3bdb2ef','five','random',0,'{}',5.73559774617720563583e-01,5.94168449311777480126e-01,-3.46849024345332601626e-02,'PROPAGATED',5.73559774617720563583e-01,'[0.032904269089610354,0.03668471193655343,0.025052159479152833,0.029720869317391936]','[0.0075,0.0075,0.0075,0.0075,0.0075]','[0.048,0.048,0.048,0.048,0.048]',10,50,2.89261129998976684873e-02,'[[10,50,0.028808016999846586,0.5735597750269329],[10,50,0.02892611299989767,0.5735597750269329]]','{"python":"3.11.7","domino-chains":"0.1.0","numpy":"2.4.6","scipy":"1.17.1","numba":"0.68.1","cma":"4.5.0"}');
CREATE TABLE scenes (
	digest TEXT NOT NULL, 
	toml TEXT NOT NULL, 
	PRIMARY KEY (digest)
);
INSERT INTO "scenes" VALUES('47143a4cd3e8b948fcdf52dde3bdb2ef','name = "five"
title = "Five dominoes"
objective = "mean_speed"

[row]
count = 5
height = 0.048
width = 0.024
density = 1040.0
first_thickness = 0.0075

[spacing]
min = 0.002
max = 0.04

[thickness]
fixed = 0.0075

[physics]
friction = 0.25
gravity = 9.81
push = 8.0
');
INSERT INTO "scenes" VALUES('b6fefc291f3a403f981bdd368f3d13ec','name = "five"
title = "Five dominoes"
objective = "mean_speed"

[row]
count = 5
height = 0.048
width = 0.024
density = 1040.0
first_thickness = 0.0075

[spacing]
min = 0.002
max = 0.04

[thickness]
fixed = 0.0075

[physics]
friction = 0.25
gravity = 9.81
push = 9.0
');
CREATE TABLE studies (
	number INTEGER NOT NULL, 
	name TEXT NOT NULL, 
	kind TEXT NOT NULL, 
	settings TEXT NOT NULL, 
	begun TEXT NOT NULL, 
	PRIMARY KEY (number), 
	UNIQUE (name)
);
INSERT INTO "studies" VALUES(1,'sweep-five','sweep','{"digest": "a188da62025927fe60bd97e9519c6ebd", "evaluations": 20, "methods": ["random"], "random": null, "scene": "five", "seconds": null, "seed": 0, "seeds": 1, "set": ["physics.push=8,9"], "tasks": 2}','2026-11-21T23:09:56+00:00');
INSERT INTO "studies" VALUES(2,'compare-five','comparison','{"digest": "bf41b91227a138196e9102bf6227345f", "evaluations": 10, "methods": ["random"], "scenes": ["five"], "seconds": null, "seeds": 1, "tasks": 1}','2026-11-21T23:10:00+00:00');
COMMIT;
