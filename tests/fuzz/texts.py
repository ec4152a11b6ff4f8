"""Small valid files that are text."""

import json

ASCII_PLY = b"""ply
format ascii 1.0
element vertex 2
property double x
property double y
property double z
property uchar red
property uchar green
property uchar blue
end_header
0.5 1 2 255 0 9
3 4 5 1 2 3
"""

COMPOTE = {
    "compote/bap.csv": b"k,l,u,v,rho,cluster,frame\n0,0,10.5,11,2,0,1\n1,0,30,11.5,2,1,1\n0,1,20,28,2,0,2\n",
    "compote/centers.csv": b"k,l,u,v\n0,0,10,10\n1,0,30,10\n0,1,20,27\n1,1,40,27\n",
    "compote/camera.json": json.dumps({
        "I": 3, "main_lens": {"f": 50.0}, "sensor": {"scale": 0.0055, "width": 80, "height": 60},
    }).encode(),
    "compote/scene.json": b'{"checkerboards": [{"y_grid": 5, "x_grid": 9, "lph": 10.0}]}',
}  # fmt: skip

RAYTRIX = b"""<RayCalibData version="1.0">
<offset units="pix"><x>1.5</x><y>-2.25</y></offset><diameter units="pix">9.5</diameter>
<rotation units="rad">0.01</rotation>
<lens_base_x units="lens"><x>1.0</x><y>0.0</y></lens_base_x>
<lens_base_y units="lens"><x>0.5</x><y>-0.8660254</y></lens_base_y>
<lens_type id="0"><offset units="lens"><x>0.0</x><y>0.0</y></offset>
<depth_range><min>1.0</min><max>3.0</max></depth_range></lens_type>
<lens_type id="1"><offset units="lens"><x>1.0</x><y>0.0</y></offset>
<depth_range><min>2.8</min><max>4.0</max></depth_range></lens_type>
<lens_type id="2"><offset units="lens"><x>-1.0</x><y>0.0</y></offset>
<depth_range><min>3.8</min><max>100.0</max></depth_range></lens_type>
</RayCalibData>
"""

PLENOPTOMOS = b"""[micro_lenses_array]
z=400.0
[micro_lens]
physical_size_s=300e-3
f2=18.6
[sensor]
pixel_size_x=6.45e-3
pixel_size_y=6.45e-3
size_x=138
size_y=103
z=418.6
"""
