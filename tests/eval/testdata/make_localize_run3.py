"""Makes localize_run3, a made-up localize result: run3 of the rendered lot with known noise.

  python3 make_localize_run3.py TRUTH_DIR OUT_DIR
"""
import numpy as np, os, sys, csv
rng=np.random.default_rng(5)
T, out = sys.argv[1:3]; os.makedirs(out,exist_ok=True)
def tum(p): return [(l.split()[0],np.array(l.split()[1:],float)) for l in open(p) if l.strip() and l[0]!="#"]
def q2R(q): x,y,z,w=q; return np.array([[1-2*(y*y+z*z),2*(x*y-w*z),2*(x*z+w*y)],[2*(x*y+w*z),1-2*(x*x+z*z),2*(y*z-w*x)],[2*(x*z-w*y),2*(y*z+w*x),1-2*(x*x+y*y)]])
def qmul(a,b): ax,ay,az,aw=a; bx,by,bz,bw=b; return np.array([aw*bx+ax*bw+ay*bz-az*by,aw*by-ax*bz+ay*bw+az*bx,aw*bz+ax*by-ay*bx+az*bw,aw*bw-ax*bx-ay*by-az*bz])
def ex(w): a=np.linalg.norm(w); return np.r_[np.sin(a/2)*w/a,np.cos(a/2)]
q0=ex(np.array([0.02,-0.03,2.1])); R0=q2R(q0); t0=np.array([5.,-4.,1.5]); k=1.006   # odom_from_world, scale off
cams=tum(f"{T}/runs/run3_cameras.tum"); pan=tum(f"{T}/panoramas.tum")

C=np.array([c[1][:3] for c in cams])
odom=open(f"{out}/cameras_odom.tum","w"); world=open(f"{out}/cameras.tum","w"); rows=open(f"{out}/cameras.csv","w")
rows.write("timestamp,image,camera,x,y,z,qx,qy,qz,qw,latitude_deg,longitude_deg,height_m,sigma_e_m,sigma_n_m,sigma_u_m,heading_deg,pitch_deg,roll_deg,sigma_heading_deg,sigma_pitch_deg,sigma_roll_deg\n")
drift=np.cumsum(rng.normal(0,0.01,(len(cams),3)),0)
off=np.array([0.2,-0.1,0.15])
for (s,v),d in zip(cams,drift):
    p=k*(R0@v[:3])+t0+d; q=qmul(q0,v[3:]); odom.write(s+" "+" ".join(f"{x:.9f}" for x in np.r_[p,q])+"\n")
    w=v[:3]+off+rng.normal(0,0.02,3); world.write(s+" "+" ".join(f"{x:.9f}" for x in np.r_[w,v[3:]])+"\n")
    rows.write(f"{s},{s}.jpg,cam0,"+",".join(f"{x:.9f}" for x in np.r_[w,v[3:]])+",,,,0.21,0.19,0.25,,,,,,\n")
cols="panorama,station,status,reason,x,y,z,qx,qy,qz,qw,sigma_x_m,sigma_y_m,sigma_z_m,view_matches,inliers,views,odom_x,odom_y,odom_z,odom_qx,odom_qy,odom_qz,odom_qw,latitude_deg,longitude_deg,height_m,heading_deg,pitch_deg,roll_deg,geotag_de_m,geotag_dn_m,geotag_du_m,geotag_status".split(",")
with open(f"{out}/panoramas.csv","w") as f:
    f.write("# trigpoint panoramas 1; frame=enu; datum=geotags; sigma=1\n"); w=csv.DictWriter(f,cols,lineterminator="\n"); w.writeheader()
    for s,v in pan:
        st=f"S{int(float(s)):03d}"; r=dict(panorama=f"panoramas/pano_{int(float(s)):03d}.jpg",station=st)
        dist=np.linalg.norm(C-v[:3],axis=1)
        if dist.min()>14: r.update(status="unmatched",reason="no view matched"); w.writerow(r); continue
        if int(float(s))==65: r.update(status="rejected",reason="two hypotheses agree with its views"); w.writerow(r); continue
        i=dist.argmin(); e=rng.normal(0,0.05,3)
        po=k*(R0@v[:3])+t0+drift[i]+R0@e; qo=qmul(q0,v[3:]); pw=v[:3]+off+e
        r.update(status="localized",x=f"{pw[0]:.9f}",y=f"{pw[1]:.9f}",z=f"{pw[2]:.9f}",sigma_x_m=0.2,sigma_y_m=0.2,sigma_z_m=0.2,inliers=300,views=4)
        for n,x in zip(("qx","qy","qz","qw"),v[3:]): r[n]=f"{x:.9f}"
        for n,x in zip(("x","y","z","qx","qy","qz","qw"),np.r_[po,qo]): r["odom_"+n]=f"{x:.9f}"
        w.writerow(r)
