// Renderer, light, camera: all of three's scene but what stands in it.
import {DirectionalLight, HemisphereLight, PCFShadowMap, PerspectiveCamera, Raycaster, Scene, SRGBColorSpace, Vector2, Vector3, WebGLRenderer} from 'three';
import {OrbitControls} from 'three/addons/controls/OrbitControls.js';

const SIGHT = new Vector3(0.62, -1, 0.36).normalize();  // from the scene to the eye

const PLAIN = 0.75;  // drawn pixels a pixel

// Whether the CPU draws. The names are those of Chromium, Mesa and Windows.
function drawsWithoutGpu() {
  const gl = document.createElement('canvas').getContext('webgl2'), told = gl?.getExtension('WEBGL_debug_renderer_info');
  const name = gl ? String(gl.getParameter(told ? told.UNMASKED_RENDERER_WEBGL : gl.RENDERER)) : '';
  gl?.getExtension('WEBGL_lose_context')?.loseContext();
  return /swiftshader|llvmpipe|softpipe|software|basic render/i.test(name);
}

export class Stage {
  // onChange: the picture is to be drawn anew.
  constructor(canvas, onChange) {
    this.canvas = canvas;
    this.slow = drawsWithoutGpu();
    // Multisampling costs a CPU 10 to 30 ms a picture; it draws those that stay with more pixels instead.
    this.renderer = new WebGLRenderer({canvas, antialias: !this.slow, powerPreference: 'high-performance'});
    this.renderer.outputColorSpace = SRGBColorSpace;
    this.renderer.shadowMap.enabled = true;
    this.renderer.shadowMap.type = PCFShadowMap;
    this.renderer.shadowMap.autoUpdate = false;
    this.scene = new Scene();
    this.camera = new PerspectiveCamera(32, 1, 0.1, 1000);
    this.camera.up.set(0, 0, 1);
    this.controls = new OrbitControls(this.camera, canvas);
    this.controls.addEventListener('change', onChange);
    this.sky = new HemisphereLight(0xffffff, 0x8a8f99, 1.5);
    this.sky.position.set(0, 0, 1);
    this.sun = new DirectionalLight(0xffffff, 2.2);
    this.sun.castShadow = true;
    this.sun.shadow.mapSize.set(2048, 2048);
    this.sun.shadow.radius = 4;
    this.scene.add(this.sky, this.sun, this.sun.target);
    this.prepare(false, false);
    this.onChange = onChange;
  }

  // extent: Box3 of what is to be seen.
  setExtent(extent) {
    this.extent = extent;
    const middle = extent.getCenter(new Vector3()), radius = 0.5 * extent.getSize(new Vector3()).length();
    this.sun.target.position.copy(middle);
    this.sun.position.copy(middle).addScaledVector(new Vector3(0.45, -0.5, 1.3).normalize(), 2.2 * radius);
    Object.assign(this.sun.shadow.camera, {left: -radius, right: radius, top: radius, bottom: -radius, near: 0.1 * radius, far: 5 * radius});
    this.sun.shadow.normalBias = radius / 800;
    this.sun.shadow.camera.updateProjectionMatrix();
    this.controls.minDistance = 0.02 * radius;
    this.controls.maxDistance = 12 * radius;
    this.resetCamera();
  }

  // The nearest place on the line of sight from which all corners are seen.
  resetCamera() {
    const {camera, extent} = this;
    const middle = extent.getCenter(new Vector3());
    const right = new Vector3().crossVectors(camera.up, SIGHT).normalize(), up = new Vector3().crossVectors(SIGHT, right);
    const tall = Math.tan((camera.fov * Math.PI) / 360) * 0.9, wide = tall * camera.aspect;
    let distance = 0;
    for (let k = 0; k < 8; ++k) {
      const corner = new Vector3(k & 1 ? extent.max.x : extent.min.x, k & 2 ? extent.max.y : extent.min.y, k & 4 ? extent.max.z : extent.min.z).sub(middle);
      const aside = Math.max(Math.abs(corner.dot(right)) / wide, Math.abs(corner.dot(up)) / tall);
      distance = Math.max(distance, corner.dot(SIGHT) + aside);
    }
    camera.position.copy(middle).addScaledVector(SIGHT, distance);
    camera.near = distance / 200;
    camera.far = distance * 40;
    camera.updateProjectionMatrix();
    this.controls.target.copy(middle);
    this.controls.update();
    this.onChange();
  }

  resize() {
    const {clientWidth, clientHeight} = this.canvas.parentElement;
    if (clientWidth === 0 || clientHeight === 0) return;
    const before = this.camera.aspect;
    this.renderer.setSize(clientWidth, clientHeight, false);
    this.camera.aspect = clientWidth / clientHeight;
    this.camera.updateProjectionMatrix();
    if (this.extent && Math.abs(before / this.camera.aspect - 1) > 0.2) this.resetCamera();
    this.onChange();
  }

  setTheme({background, dark}) {
    this.renderer.setClearColor(background, 1);
    this.sky.intensity = dark ? 1.25 : 1.7;
    this.sun.intensity = dark ? 2.0 : 2.3;
    this.sky.groundColor.set(dark ? 0x3a4250 : 0x9aa1ab);
  }

  // plain: fewer pixels, no shadows. still: the picture stays, so it may take its time.
  prepare(plain, still) {
    const fine = this.slow && still ? 2 : Math.min(window.devicePixelRatio, 2), ratio = plain ? PLAIN : fine;
    if (ratio !== this.renderer.getPixelRatio()) this.renderer.setPixelRatio(ratio);
    this.sun.castShadow = !plain;
  }

  shadowsChanged() {
    this.renderer.shadowMap.needsUpdate = true;
  }

  render() {
    this.renderer.render(this.scene, this.camera);
  }

  // x, y: [px] of the window.
  ray(x, y) {
    const box = this.canvas.getBoundingClientRect();
    const raycaster = new Raycaster();
    raycaster.setFromCamera(new Vector2((2 * (x - box.left)) / box.width - 1, 1 - (2 * (y - box.top)) / box.height), this.camera);
    return raycaster;
  }
}
